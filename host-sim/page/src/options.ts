// Drawing options of the viewer.

export interface ViewOptions {
  surfaces: boolean;
  wireframe: boolean;
  particles: boolean;
  ellipsoids: boolean;
  groups: boolean;
  links: boolean;
  planes: boolean;
  proxies: boolean; // the spheres of a tool that has a mesh
  arrows: boolean; // force and torque
  pressure: boolean; // of contacts, as colours of the surfaces
  ground: boolean;
  dropLine: boolean; // from the tool to what is below it
  region: boolean; // of the device
  follow: boolean; // the camera keeps the tool in the picture
}

export const defaultOptions: ViewOptions = {
  surfaces: true,
  wireframe: false,
  particles: false,
  ellipsoids: false,
  groups: false,
  links: false,
  planes: false,
  proxies: false,
  arrows: true,
  pressure: true,
  ground: true,
  dropLine: true,
  region: true,
  follow: true,
};

/** Label, shortcut key and meaning of each option. */
export const optionLabels: { option: keyof ViewOptions; label: string; key: string; meaning: string }[] = [
  { option: "surfaces", label: "Surfaces", key: "1", meaning: "The surfaces of bodies and tool" },
  { option: "wireframe", label: "Wireframe", key: "2", meaning: "The edges of the triangles" },
  { option: "particles", label: "Particles", key: "3", meaning: "The points that move, and carry the surfaces" },
  { option: "ellipsoids", label: "Ellipsoids", key: "4", meaning: "The particles' volumes, with which bodies collide" },
  { option: "groups", label: "Groups", key: "5", meaning: "Particles that keep their shape together" },
  { option: "links", label: "Links", key: "6", meaning: "Particles that keep their distance" },
  { option: "planes", label: "Contact planes", key: "7", meaning: "The planes that the device renders" },
  { option: "proxies", label: "Tool's spheres", key: "8", meaning: "The spheres that stand for the tool in contacts" },
  { option: "arrows", label: "Force and torque", key: "9", meaning: "Arrows of what acts on the tool" },
  { option: "pressure", label: "Contact pressure", key: "e", meaning: "How the contact force spreads on the surface" },
  { option: "ground", label: "Ground", key: "0", meaning: "Without it the camera may look from below" },
  {
    option: "dropLine",
    label: "Line to the ground",
    key: "d",
    meaning: "From the tool straight down to what is below it",
  },
  { option: "region", label: "Device's reach", key: "w", meaning: "Where the device lets the grip move freely" },
  { option: "follow", label: "Follow the tool", key: "l", meaning: "The camera keeps the tool in the picture" },
];
