// The page's custom properties as colours that a canvas takes.

const probe = document.createElement("span");
probe.hidden = true;

/** What `--name` is now, in light or dark: a custom property itself would read as the words light-dark(...). */
export function colourOf(name: string): string {
  if (!probe.isConnected) {
    document.body.append(probe);
  }
  probe.style.color = `var(--${name})`;
  return getComputedStyle(probe).color;
}

/** Whether the page is dark now. */
export function isDark(): boolean {
  const [r = 0, g = 0, b = 0] = (colourOf("paper").match(/[\d.]+/g) ?? []).map(Number);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b < 128;
}
