// Appearance: light, dark or system colours, and large text for a projector. Stored in the browser if possible.
import { checkbox, element } from "./dom.ts";

const themes = { auto: "light dark", light: "light", dark: "dark" } as const;
type Theme = keyof typeof themes;

function stored(key: string): string | null {
  try {
    return localStorage.getItem(`haptic-view.${key}`);
  } catch {
    return null; // storage is disabled
  }
}

function store(key: string, value: string): void {
  try {
    localStorage.setItem(`haptic-view.${key}`, value);
  } catch {
    // Storage is disabled: the setting lasts until the page is closed.
  }
}

/**
 * Applies the stored appearance and creates its controls; `onChange` is called after each change of colours or sizes.
 */
export function createTheme(onChange: () => void): HTMLElement {
  const root = document.documentElement;
  const select = element("select", { id: "theme" });
  const names: Record<Theme, string> = { auto: "System", light: "Light", dark: "Dark" };
  for (const theme of Object.keys(themes) as Theme[]) {
    select.append(element("option", { value: theme }, names[theme]));
  }
  const before = stored("theme") ?? "auto";
  select.value = before in themes ? before : "auto";
  const apply = (): void => {
    root.style.colorScheme = themes[select.value as Theme];
    onChange();
  };
  select.addEventListener("change", () => {
    store("theme", select.value);
    apply();
  });
  const enlarge = (large: boolean): void => {
    root.classList.toggle("large", large);
    store("large", String(large));
    onChange();
  };
  const large = stored("large") === "true";
  root.classList.toggle("large", large);
  root.style.colorScheme = themes[select.value as Theme];
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", onChange);
  return element(
    "div",
    { class: "rows" },
    element("label", { class: "row" }, "Colours", select),
    checkbox("Large text", large, enlarge),
  );
}
