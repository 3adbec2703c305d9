// CSS custom properties as colours for a canvas.

const probe = document.createElement("span");
probe.hidden = true;

/**
 * The current value of `--name` in light or dark mode; read directly, a custom property would be the text light-
 * dark(...).
 */
export function colourOf(name: string): string {
  if (!probe.isConnected) {
    document.body.append(probe);
  }
  probe.style.color = `var(--${name})`;
  return getComputedStyle(probe).color;
}

/** Whether the page is in dark mode. */
export function isDark(): boolean {
  const [r = 0, g = 0, b = 0] = (colourOf("paper").match(/[\d.]+/g) ?? []).map(Number);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b < 128;
}
