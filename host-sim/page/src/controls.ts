// All of the page that is not the picture.
import type { Actions } from "./actions.ts";
import type { ConnectionState } from "./connection.ts";
import { found, setText } from "./dom.ts";
import { createHelp } from "./help.ts";
import { listenToKeys } from "./keyboard.ts";
import { createPanel } from "./panel.ts";
import { Plots } from "./plots.ts";
import type { DeviceMessage, Frame, RecordMessage, RefusedMessage, Samples, SceneMessage } from "./protocol.ts";
import { type ArrowScales, Status } from "./status.ts";
import { createTheme } from "./theme.ts";
import { Timeline } from "./timeline.ts";

const narrow = "(max-width: 760px)";

/** Takes what comes, as it comes; writes no more often than can be read. */
export interface Controls {
  showState(state: ConnectionState): void;
  showScene(scene: SceneMessage): void;
  showFrame(frame: Frame, scales: ArrowScales): void;
  showSamples(samples: Samples): void;
  showDevice(device: DeviceMessage): void;
  showRefused(refused: RefusedMessage): void;
  showRecord(record: RecordMessage): void;
}

/** Fills the elements of index.html. */
export function createControls(actions: Actions): Controls {
  const help = found("help") as HTMLDialogElement;
  createHelp(help);
  const status = new Status();
  const plots = new Plots(found("plots"));
  const timeline = new Timeline(found("timeline"), actions);
  const theme = createTheme(() => {
    plots.takeColours();
    actions.takeColours();
  });
  const panelRoot = found("panel");
  const panel = createPanel(panelRoot, actions, theme);
  const small = matchMedia(narrow).matches; // there the picture comes first
  const togglePanel = foldable("toggle-panel", !small, (on) => (panelRoot.hidden = !on));
  const togglePlots = foldable("toggle-plots", !small, (on) => plots.show(on));
  const openHelp = (): void => help.showModal();
  found("open-help").addEventListener("click", openHelp);
  const handMode = found("hand-mode");
  listenToKeys(actions, panel, {
    togglePanel,
    togglePlots,
    help: openHelp,
    showHandMode: (on) => {
      handMode.hidden = !on;
      setText(handMode, on ? "Arrow keys move the hand, Page Up and Page Down in depth; Esc ends." : "");
    },
  });
  return {
    showState: (state) => status.showState(state),
    showScene: (scene) => {
      status.showScene(scene);
      panel.showScene(scene);
      timeline.showScene(scene);
      plots.showScene(scene);
    },
    showFrame: (frame, scales) => {
      status.showFrame(frame, scales);
      panel.showFrame(frame);
      timeline.showFrame(frame);
    },
    showSamples: (samples) => plots.showSamples(samples),
    showDevice: (device) => plots.showDevice(device),
    showRefused: (refused) => status.showRefused(refused),
    showRecord: (record) => panel.showRecord(record),
  };
}

/** A button that folds a part of the page; what it returns does the same. */
function foldable(id: string, open: boolean, show: (on: boolean) => void): () => void {
  const button = found(id);
  const set = (on: boolean): void => {
    button.setAttribute("aria-expanded", String(on));
    show(on);
  };
  const toggle = (): void => set(button.getAttribute("aria-expanded") !== "true");
  button.addEventListener("click", toggle);
  set(open);
  return toggle;
}
