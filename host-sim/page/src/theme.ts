// Light, dark or as the system is; and larger letters, for a projector. Kept in the browser, if it keeps anything.
import { checkbox, element } from "./dom.ts";

const themes = { auto: "light dark", light: "light", dark: "dark" } as const;
type Theme = keyof typeof themes;

function kept(key: string): string | null {
  try {
    return localStorage.getItem(`haptic-view.${key}`);
  } catch {
    return null; // storage is switched off
  }
}

function keep(key: string, value: string): void {
  try {
    localStorage.setItem(`haptic-view.${key}`, value);
  } catch {
    // It holds until the page is closed.
  }
}

/** Applies what was chosen before and makes the controls for it; `onChange` after each change of colours or sizes. */
export function createTheme(onChange: () => void): HTMLElement {
  const root = document.documentElement;
  const select = element("select", { id: "theme" });
  const names: Record<Theme, string> = { auto: "As the system", light: "Light", dark: "Dark" };
  for (const theme of Object.keys(themes) as Theme[]) {
    select.append(element("option", { value: theme }, names[theme]));
  }
  const before = kept("theme") ?? "auto";
  select.value = before in themes ? before : "auto";
  const apply = (): void => {
    root.style.colorScheme = themes[select.value as Theme];
    onChange();
  };
  select.addEventListener("change", () => {
    keep("theme", select.value);
    apply();
  });
  const enlarge = (large: boolean): void => {
    root.classList.toggle("large", large);
    keep("large", String(large));
    onChange();
  };
  const large = kept("large") === "true";
  root.classList.toggle("large", large);
  root.style.colorScheme = themes[select.value as Theme];
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", onChange);
  return element(
    "div",
    { class: "rows" },
    element("label", { class: "row" }, "Colours", select),
    checkbox("Large letters", large, enlarge),
  );
}
