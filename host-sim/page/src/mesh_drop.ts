// Meshes of the viewer: a file that is dropped onto the page or chosen is sent to host-sim, which makes a scene of it.
import { byId } from "./dom.ts";

export const meshTypes = ".obj,.ply,.stl,.gltf,.glb";
const maxBytes = 32 * 1024 * 1024; // as host-sim

/** The name under which host-sim knows a file: letters, digits, '.', '_' and '-', as a part of a path. */
function plainName(name: string): string {
  return name
    .replace(/[^A-Za-z0-9._-]/g, "-")
    .replace(/^\.+/, "")
    .slice(-100);
}

export class MeshDrop {
  private readonly area = byId("drop");
  private depth = 0; // of the elements that a file is dragged over
  private sending = false;

  /** `may`: whether this page may change the scene; `say` shows words, of a problem or of progress. */
  constructor(
    private readonly may: () => boolean,
    private readonly say: (words: string, problem: boolean) => void,
  ) {
    window.addEventListener("dragenter", (event) => this.over(event, 1));
    window.addEventListener("dragleave", (event) => this.over(event, -1));
    window.addEventListener("dragover", (event) => event.preventDefault());
    window.addEventListener("drop", (event) => {
      event.preventDefault(); // else the browser would show the file
      this.depth = 0;
      this.area.hidden = true;
      const file = event.dataTransfer?.files[0];
      if (file) {
        void this.send(file);
      }
    });
  }

  /** Sends a file and says what becomes of it. The new scene arrives by the stream. */
  async send(file: File): Promise<void> {
    if (!this.may()) {
      this.say("View only: start host-sim with --view-control to open a mesh from this page.", true);
    } else if (file.size > maxBytes) {
      this.say(`${file.name}: more than the ${maxBytes / 1024 / 1024} MiB allowed; simplify the mesh first`, true);
    } else if (!this.sending) {
      this.sending = true;
      this.say(`Making a scene of ${file.name} ...`, false);
      try {
        const reply = await fetch(`/mesh/${encodeURIComponent(plainName(file.name))}`, { method: "POST", body: file });
        const text = await reply.text();
        this.say(reply.ok ? `${file.name}: drag the tool onto it` : text.replace(/<[^>]*>/g, " ").trim(), !reply.ok);
      } catch {
        this.say(`${file.name}: could not be sent to host-sim`, true);
      } finally {
        this.sending = false;
      }
    }
  }

  private over(event: DragEvent, change: number): void {
    if (event.dataTransfer?.types.includes("Files")) {
      event.preventDefault();
      this.depth = Math.max(0, this.depth + change);
      this.area.hidden = this.depth === 0 || !this.may();
    }
  }
}
