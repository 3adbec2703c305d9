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
  ground: boolean;
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
  ground: true,
  follow: true,
};

/** Label and shortcut key of each option. */
export const optionLabels: { option: keyof ViewOptions; label: string; key: string }[] = [
  { option: "surfaces", label: "Surfaces", key: "1" },
  { option: "wireframe", label: "Wireframe", key: "2" },
  { option: "particles", label: "Particles", key: "3" },
  { option: "ellipsoids", label: "Ellipsoids", key: "4" },
  { option: "groups", label: "Groups", key: "5" },
  { option: "links", label: "Links", key: "6" },
  { option: "planes", label: "Contact planes", key: "7" },
  { option: "proxies", label: "Tool's spheres", key: "8" },
  { option: "arrows", label: "Force and torque", key: "9" },
  { option: "ground", label: "Ground", key: "0" },
  { option: "follow", label: "Follow the tool", key: "l" },
];
