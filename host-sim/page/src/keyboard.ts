// Keyboard shortcuts, active wherever the focus is, unless the focused control uses the key itself.
import type { Actions } from "./actions.ts";
import { optionLabels } from "./options.ts";
import type { Panel } from "./panel.ts";

const orbitStep = 0.08; // rad per key press
const panStep = 0.05; // fraction of the view's height
const zoomStep = 0.88;
const handStep = 0.01; // fraction of the view's height
const handRotationStep = 0.05; // rad

/** Keyboard actions of the page itself. */
export interface PageKeys {
  togglePanel(): void;
  togglePlots(): void;
  help(): void;
  /** Shows whether the arrow keys move the hand. */
  showHandMode(on: boolean): void;
}

const directions: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** Listens for the lifetime of the page. */
export function listenToKeys(actions: Actions, panel: Panel, page: PageKeys): void {
  let hand = false;
  const setHand = (on: boolean): void => {
    hand = on;
    page.showHandMode(on);
  };
  const letters: Record<string, () => void> = {
    " ": () => panel.togglePause(),
    ".": () => panel.step(),
    r: () => panel.reset(),
    f: () => actions.frameAll(),
    t: () => actions.frameTool(),
    c: () => page.togglePanel(),
    p: () => page.togglePlots(),
    h: () => setHand(!hand && panel.canMoveHand()),
    s: () => actions.savePicture(),
    v: () => actions.toggleVideo(),
    escape: () => actions.clearPick(),
    "?": () => page.help(),
    "+": () => actions.zoom(zoomStep),
    "=": () => actions.zoom(zoomStep),
    "-": () => actions.zoom(1 / zoomStep),
  };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.isComposing || event.defaultPrevented) {
      return;
    }
    if (document.querySelector("dialog[open]") || usesKey(event.target, event.key)) {
      return;
    }
    if (hand && event.key === "Escape") {
      setHand(false);
    } else if (!(hand ? moveHand(actions, event) : moveCamera(actions, event))) {
      // A drawing option, or one of the letters; only zoom and step repeat while a key is held.
      const option = optionLabels.find(({ key }) => key === event.key.toLowerCase())?.option;
      const act = option ? () => panel.toggleOption(option) : letters[event.key.toLowerCase()];
      const again = event.repeat && !"+-=.".includes(event.key);
      if (!act || again) {
        return;
      }
      act();
    }
    event.preventDefault();
  });
}

/** Whether the focused control uses this key itself. */
function usesKey(target: EventTarget | null, key: string): boolean {
  if (!(target instanceof HTMLElement)) {
    return false;
  }
  if (target.matches("input[type=number], select, textarea")) {
    return true;
  }
  if (target.matches("input[type=range]")) {
    return key.startsWith("Arrow") || key.startsWith("Page") || key === "Home" || key === "End";
  }
  return target.matches("button, input, summary, a") && (key === " " || key === "Enter");
}

function moveCamera(actions: Actions, event: KeyboardEvent): boolean {
  const direction = directions[event.key];
  if (!direction) {
    return false;
  }
  const [right, up] = direction;
  if (event.shiftKey) {
    actions.pan(panStep * right, panStep * up);
  } else {
    actions.orbit(orbitStep * right, orbitStep * up);
  }
  return true;
}

function moveHand(actions: Actions, event: KeyboardEvent): boolean {
  const direction = directions[event.key];
  if (direction) {
    const [right, up] = direction;
    if (event.shiftKey) {
      actions.turnHand(handRotationStep * right, handRotationStep * up);
    } else {
      actions.moveHand(handStep * right, handStep * up, 0);
    }
    return true;
  }
  if (event.key === "PageUp" || event.key === "PageDown") {
    actions.moveHand(0, 0, event.key === "PageUp" ? handStep : -handStep);
    return true;
  }
  return false;
}
