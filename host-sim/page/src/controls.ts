// Controls of the page: everything but the 3D view.
import type { Actions } from "./actions.ts";
import type { ConnectionState } from "./connection.ts";
import { byId, setText } from "./dom.ts";
import { createHelp } from "./help.ts";
import { listenToKeys } from "./keyboard.ts";
import { createPanel } from "./panel.ts";
import { PickedCard } from "./picked.ts";
import type { Readout } from "./picker.ts";
import { Plots } from "./plots.ts";
import type { DeviceMessage, Frame, RecordMessage, RefusedMessage, Samples, SceneMessage } from "./protocol.ts";
import { type ArrowScales, Status } from "./status.ts";
import { createTheme } from "./theme.ts";
import { Timeline } from "./timeline.ts";

const narrow = "(max-width: 760px)";

/** Shows incoming messages, no more often than a user can read. */
export interface Controls {
  showState(state: ConnectionState): void;
  showScene(scene: SceneMessage): void;
  showFrame(frame: Frame, scales: ArrowScales): void;
  showSamples(samples: Samples): void;
  showDevice(device: DeviceMessage): void;
  showRefused(refused: RefusedMessage): void;
  showRecord(record: RecordMessage): void;
  /** Shows words for some seconds. */
  showWords(words: string): void;
  /** Values of what is selected; null: nothing is. */
  showPicked(readout: Readout | null): void;
  /** Words about the hand that is being dragged; empty: it is not. */
  showHint(words: string): void;
  /** Whether a video is being recorded. */
  showVideo(on: boolean): void;
}

/** Fills the elements of index.html. */
export function createControls(actions: Actions): Controls {
  const help = byId("help") as HTMLDialogElement;
  createHelp(help);
  const status = new Status();
  const plots = new Plots(byId("plots"));
  const timeline = new Timeline(byId("timeline"), actions);
  const theme = createTheme(() => {
    plots.updateColours();
    actions.updateColours();
  });
  const panelRoot = byId("panel");
  const panel = createPanel(panelRoot, actions, theme);
  // Panel and plots can be folded, by button or by key.
  const small = matchMedia(narrow).matches; // on a narrow screen the view has priority
  const togglePanel = foldable("toggle-panel", !small, (on) => (panelRoot.hidden = !on));
  const togglePlots = foldable("toggle-plots", !small, (on) => plots.show(on));
  const openHelp = (): void => help.showModal();
  byId("open-help").addEventListener("click", openHelp);
  const picked = new PickedCard(byId("picked"), () => actions.clearPick());
  const handMode = byId("hand-mode");
  let handKeys = "";
  let hint = "";
  const writeHandMode = (): void => {
    handMode.hidden = handKeys === "" && hint === "";
    setText(handMode, hint || handKeys);
  };
  listenToKeys(actions, panel, {
    togglePanel,
    togglePlots,
    help: openHelp,
    showHandMode: (on) => {
      handKeys = on ? "Arrow keys move the hand, Page Up and Page Down change its depth; Esc ends." : "";
      writeHandMode();
    },
  });
  // Pass each message to the parts that show it.
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
    showWords: (words) => status.showWords(words),
    showRecord: (record) => panel.showRecord(record),
    showPicked: (readout) => picked.show(readout),
    showHint: (words) => {
      hint = words;
      writeHandMode();
    },
    showVideo: (on) => panel.showVideo(on),
  };
}

/** Makes a button fold a part of the page; returns the toggle function. */
function foldable(id: string, open: boolean, show: (on: boolean) => void): () => void {
  const button = byId(id);
  const set = (on: boolean): void => {
    button.setAttribute("aria-expanded", String(on));
    show(on);
  };
  const toggle = (): void => set(button.getAttribute("aria-expanded") !== "true");
  button.addEventListener("click", toggle);
  set(open);
  return toggle;
}
