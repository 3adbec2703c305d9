// The device's motion, of a row of rt-core's recording, as the messages that `rt-core relay --ros` publishes.

/** @typedef {import("@foxglove/cdr").CdrWriter} CdrWriter */

/**
 * @typedef {object} MotionMessage
 * @property {string} topic below the names
 * @property {string} type
 * @property {string} definition with those of the types it has
 * @property {string[]} columns whose values it holds
 * @property {(cdr: CdrWriter, values: number[]) => void} write what follows the header
 */

/** @param {string} name @param {string} text @returns {string} a definition below that of another */
const part = (name, text) => `${"=".repeat(80)}\nMSG: ${name}\n${text}`;
const header =
  part("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n") +
  part("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const vector = part("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const pose =
  part("geometry_msgs/Pose", "Point position\nQuaternion orientation\n") +
  part("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n") +
  part("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");

/** @param {CdrWriter} cdr @param {number[]} values */
function writeDoubles(cdr, values) {
  for (const value of values) {
    cdr.float64(value);
  }
}

const buttonCount = 3;

/** @type {MotionMessage[]} */
export const motionMessages = [
  {
    topic: "pose",
    type: "geometry_msgs/msg/PoseStamped",
    definition: `std_msgs/Header header\nPose pose\n${header}${pose}`,
    columns: ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"],
    write: writeDoubles,
  },
  {
    topic: "twist",
    type: "geometry_msgs/msg/TwistStamped",
    definition: `std_msgs/Header header\nTwist twist\n${header}${part("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n")}${vector}`,
    columns: ["vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"],
    write: writeDoubles,
  },
  {
    topic: "wrench",
    type: "geometry_msgs/msg/WrenchStamped",
    definition: `std_msgs/Header header\nWrench wrench\n${header}${part("geometry_msgs/Wrench", "Vector3 force\nVector3 torque\n")}${vector}`,
    columns: ["made_fx_n", "made_fy_n", "made_fz_n", "made_tx_nm", "made_ty_nm", "made_tz_nm"],
    write: writeDoubles,
  },
  {
    topic: "joy",
    type: "sensor_msgs/msg/Joy",
    definition: `std_msgs/Header header\nfloat32[] axes\nint32[] buttons\n${header}`,
    columns: ["buttons"],
    write(cdr, [buttons]) {
      cdr.sequenceLength(0).sequenceLength(buttonCount);
      for (let k = 0; k < buttonCount; ++k) {
        cdr.int32((buttons >>> k) & 1);
      }
    },
  },
];
