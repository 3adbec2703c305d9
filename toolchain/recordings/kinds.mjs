// The kinds of recordings, by their columns: the type of each column, its unit, and the time of a row.

/**
 * @typedef {object} Kind
 * @property {string} type of the message that holds a row
 * @property {string} topic below the names
 * @property {string[]} signs columns that no other kind has together
 * @property {string} time column: a time in ns, or one in s since the note time-zero-ns
 * @property {RegExp} integers columns of 64-bit integers; all others are doubles
 * @property {RegExp} naturals of these, the unsigned
 */

/** @type {Kind[]} */
const kinds = [
  {
    // rt-core/src/measure/recording.cpp
    type: "TickRecord",
    topic: "ticks",
    signs: ["tick", "now_ns", "deadline_ns"],
    time: "now_ns",
    integers:
      /^(flags|tick|(now|deadline|overlay_time)_ns|missed|requests|safety_state|faults|cut|exchange_(in|out)|(counter|analog|digit)[0-7]|buttons|rotary|frame_read|frame_sequence|in_contact|overlay_read)$/,
    naturals: /^(tick|frame_sequence)$/,
  },
  {
    // rt-core/src/measure/frame_recording.cpp
    type: "FrameRecord",
    topic: "frames",
    signs: ["now_ns", "defect", "particle", "plane_time_ns"],
    time: "now_ns",
    integers:
      /^((now|state_time|plane_time|publish_time|step)_ns|defect|particle|(state_)?sequence|session|(proxy|plane)_count|frame_flags|compliance_rows|reserved|in_contact)$/,
    naturals: /^((state_)?sequence|session)$/,
  },
  {
    type: "ComplianceRecord",
    topic: "compliance",
    signs: ["now_ns", "row", "column0"],
    time: "now_ns",
    integers: /^(now_ns|row)$/,
    naturals: /^$/,
  },
  {
    // host-sim/src/app/step_record.cpp, which writes each number as a double
    type: "StepRecord",
    topic: "steps",
    signs: ["time_s", "hip_x_m", "step_us"],
    time: "time_s",
    integers: /^$/,
    naturals: /^$/,
  },
];

/** Units by the end of a column's name, the longest first. */
const units = [
  ["_rad_s", "rad/s"],
  ["_n_m", "N/m"],
  ["_n_s", "N s"],
  ["_m_s", "m/s"],
  ["_nm", "N m"],
  ["_ms", "ms"],
  ["_us", "us"],
  ["_ns", "ns"],
  ["_m", "m"],
  ["_n", "N"],
  ["_s", "s"],
  ["_j", "J"],
];

/** @param {string[]} columns @returns {Kind | undefined} */
export function kindOf(columns) {
  return kinds.find((kind) => kind.signs.every((sign) => columns.includes(sign)));
}

/** @param {Kind} kind @param {string} column @returns {"float64" | "int64" | "uint64"} */
export function typeOf(kind, column) {
  return kind.naturals.test(column) ? "uint64" : kind.integers.test(column) ? "int64" : "float64";
}

/** The definition of a row's message: a field a column, its unit as a comment. @param {Kind} kind @param {string[]} columns */
export function definitionOf(kind, columns) {
  return columns
    .map((column) => {
      const unit = units.find(([end]) => column.endsWith(end))?.[1];
      return `${typeOf(kind, column)} ${column}${unit ? `  # ${unit}` : ""}\n`;
    })
    .join("");
}
