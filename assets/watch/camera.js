// A camera that turns around what it looks at. Angles in radians, positions in world space; poses are plain objects
// {eye, target, up} as the server knows them.

const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scale = (a, s) => a.map((x) => x * s);
const length = (a) => Math.sqrt(dot(a, a));
const unit = (a) => scale(a, 1 / length(a));

function frame(pose) {
  const back = unit(add(pose.eye, pose.target, -1));
  const right = unit(cross(pose.up, back));
  return { right, up: cross(back, right), back };
}

// Rodrigues' rotation.
function rotate(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(scale(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

/** Turns around the target: first about the world's up, then about the camera's right, not over the poles. */
export function orbit(pose, aboutUp, aboutRight) {
  const up = Math.abs(frame(pose).up[1]) > 0.05 ? [0, Math.sign(frame(pose).up[1]), 0] : frame(pose).up;
  let arm = rotate(add(pose.eye, pose.target, -1), up, -aboutUp);
  const turned = { ...pose, eye: add(pose.target, arm), up: rotate(frame(pose).up, up, -aboutUp) };
  const { right } = frame(turned);
  const polar = Math.acos(Math.min(1, Math.max(-1, dot(unit(arm), up))));
  const angle = Math.min(Math.max(polar - aboutRight, 0.02), Math.PI - 0.02) - polar;
  arm = rotate(arm, right, angle);
  return { eye: add(pose.target, arm), target: pose.target, up: rotate(frame(turned).up, right, angle) };
}

/** Moves camera and target alongside, in units of the distance between them. */
export function pan(pose, x, y) {
  const { right, up } = frame(pose);
  const distance = length(add(pose.eye, pose.target, -1));
  const way = add(scale(right, x * distance), up, y * distance);
  return { ...pose, eye: add(pose.eye, way), target: add(pose.target, way) };
}

/** Multiplies the distance to the target. */
export function dolly(pose, factor) {
  return { ...pose, eye: add(pose.target, add(pose.eye, pose.target, -1), factor) };
}
