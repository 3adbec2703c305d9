// Elements of the page, made and found.

type Attributes = Record<string, string | number | boolean>;

/** An element with these attributes (false: without it) and what is in it. */
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

/** A box with its words, which hands on what it becomes. */
export function checkbox(words: string, checked: boolean, onChange: (on: boolean) => void): HTMLLabelElement {
  const input = element("input", { type: "checkbox" });
  input.checked = checked;
  input.addEventListener("change", () => onChange(input.checked));
  return element("label", { class: "check" }, input, words);
}

/** By its id in index.html. */
export function found(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (!element) {
    throw new Error(`index.html has no element with the id ${id}`);
  }
  return element;
}

/** Writes only what has changed, so that a screen reader and the layout are left in peace. */
export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) {
    element.textContent = text;
  }
}

/** Calls `act` with the newest argument, at once and then every `wait` ms at most; the last one is never lost. */
export function paced<Argument>(wait: number, act: (argument: Argument) => void): (argument: Argument) => void {
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
