// Helpers for DOM elements.

type Attributes = Record<string, string | number | boolean>;

/** Creates an element with attributes (false: omitted) and children. */
export function element<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  attributes: Attributes = {},
  ...inside: (Node | string)[]
): HTMLElementTagNameMap[Tag] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== false) {
      made.setAttribute(name, value === true ? "" : String(value));
    }
  }
  made.append(...inside);
  return made;
}

export function button(text: string, onClick: () => void, attributes: Attributes = {}): HTMLButtonElement {
  const made = element("button", { type: "button", ...attributes }, text);
  made.addEventListener("click", onClick);
  return made;
}

/** A labelled check box that reports its changes. */
export function checkbox(words: string, checked: boolean, onChange: (on: boolean) => void): HTMLLabelElement {
  const input = element("input", { type: "checkbox" });
  input.checked = checked;
  input.addEventListener("change", () => onChange(input.checked));
  return element("label", { class: "check" }, input, words);
}

/** The element of index.html with this id. */
export function byId(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (!element) {
    throw new Error(`index.html has no element with the id ${id}`);
  }
  return element;
}

/** Sets the text only if it differs, to avoid needless layout and screen-reader announcements. */
export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) {
    element.textContent = text;
  }
}

/** Calls `act` with the newest argument, at once and then at most every `wait` ms; the last argument is never lost. */
export function throttle<Argument>(wait: number, act: (argument: Argument) => void): (argument: Argument) => void {
  let timer: ReturnType<typeof setTimeout> | null = null;
  let waiting: { argument: Argument } | null = null;
  const go = (): void => {
    timer = null;
    if (waiting) {
      const { argument } = waiting;
      waiting = null;
      timer = setTimeout(go, wait);
      act(argument);
    }
  };
  return (argument) => {
    waiting = { argument };
    if (timer === null) {
      go();
    }
  };
}
