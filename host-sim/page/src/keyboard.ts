// What keys do, wherever the focus is, unless it is in a control that wants them itself.
import type { Actions } from "./actions.ts";
import { optionLabels } from "./options.ts";
import type { Panel } from "./panel.ts";

const turn = 0.08; // rad a key
const shift = 0.05; // of the picture's height
const nearer = 0.88;
const handShift = 0.01; // of the picture's height
const handTurn = 0.05; // rad

/** What keys do that is neither the scene's nor the panel's. */
export interface PageKeys {
  togglePanel(): void;
  togglePlots(): void;
  help(): void;
  /** Whether arrows move the hand now. */
  showHandMode(on: boolean): void;
}

const directions: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** Listens until the page is closed. */
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
    h: () => setHand(!hand && panel.movesHand()),
    "?": () => page.help(),
    "+": () => actions.zoom(nearer),
    "=": () => actions.zoom(nearer),
    "-": () => actions.zoom(1 / nearer),
  };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.isComposing || event.defaultPrevented) {
      return;
    }
    if (document.querySelector("dialog[open]") || wantedBy(event.target, event.key)) {
      return;
    }
    if (hand && event.key === "Escape") {
      setHand(false);
    } else if (!(hand ? moveHand(actions, event) : moveCamera(actions, event))) {
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

/** Whether a control that has the focus uses this key. */
function wantedBy(target: EventTarget | null, key: string): boolean {
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
    actions.pan(shift * right, shift * up);
  } else {
    actions.orbit(turn * right, turn * up);
  }
  return true;
}

function moveHand(actions: Actions, event: KeyboardEvent): boolean {
  const direction = directions[event.key];
  if (direction) {
    const [right, up] = direction;
    if (event.shiftKey) {
      actions.turnHand(handTurn * right, handTurn * up);
    } else {
      actions.moveHand(handShift * right, handShift * up, 0);
    }
    return true;
  }
  if (event.key === "PageUp" || event.key === "PageDown") {
    actions.moveHand(0, 0, event.key === "PageUp" ? handShift : -handShift);
    return true;
  }
  return false;
}
