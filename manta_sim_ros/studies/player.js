'use strict';
// Moves the robot in both views and the cursor in all curves to the time of the slider.
const swim = JSON.parse(document.getElementById('swim').textContent);
const [robot, path, curves] = ['robot', 'path', 'curves'].map(name => document.getElementById(name));
const [play, slider, time, speed, gait] =
  ['play', 'slider', 'time', 'speed', 'gait'].map(name => document.getElementById(name));
const last = swim.time.length - 1;

function numbers(base64) {
  return new Float32Array(Uint8Array.from(atob(base64), character => character.charCodeAt(0)).buffer);
}

const position = numbers(swim.position), rotation = numbers(swim.rotation);  // 3 and 9 numbers for each frame
const parts = swim.parts.map(part => ({
  count: part.count, fixed: part.fixed, points: numbers(part.points), angles: part.angles && numbers(part.angles)}));

// The coordinates of a part in a frame: rotated, and moved where `to` is a position.
function placed(part, frame, to) {
  const r = rotation.subarray(9 * frame, 9 * frame + 9), first = part.fixed ? 0 : 3 * part.count * frame;
  const [x, y, z] = [0, 1, 2].map(() => new Float32Array(part.count));
  for (let k = 0; k < part.count; k++) {
    const [a, b, c] = part.points.subarray(first + 3 * k, first + 3 * k + 3);
    x[k] = to[0] + r[0] * a + r[1] * b + r[2] * c;
    y[k] = to[1] + r[3] * a + r[4] * b + r[5] * c;
    z[k] = to[2] + r[6] * a + r[7] * b + r[8] * c;
  }
  return {x, y, z};
}

function restyle(view, frame, to) {
  const at = parts.map(part => placed(part, frame, to));
  const changed = {x: at.map(each => each.x), y: at.map(each => each.y), z: at.map(each => each.z)};
  if (parts.some(part => part.angles))
    changed.intensity = parts.map(part =>
      part.angles ? part.angles.subarray(part.count * frame, part.count * (frame + 1)) : undefined);
  return Plotly.restyle(view, changed, parts.map((part, index) => index));
}

let drawing = false;

async function show(frame) {
  slider.value = frame;
  time.textContent = swim.time[frame].toFixed(2) + ' s';
  gait.textContent = swim.gait[frame];
  if (drawing) return;  // the last frame that was asked for is drawn below
  drawing = true;
  const to = position.subarray(3 * frame, 3 * frame + 3), now = swim.time[frame];
  await Promise.all([
    restyle(robot, frame, [0, 0, 0]), restyle(path, frame, to),
    Plotly.relayout(curves, {'shapes[0].x0': now, 'shapes[0].x1': now})]);
  document.body.dataset.frame = frame;
  drawing = false;
  if (+slider.value !== frame) show(+slider.value);
}

function frameAt(moment) {
  let low = 0, high = last;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (swim.time[middle] < moment) low = middle + 1; else high = middle;
  }
  return low;
}

let playing = false, moment = 0, before = 0;

function step(now) {
  if (!playing) return;
  moment += (now - before) / 1000 * speed.value;
  before = now;
  show(frameAt(moment));
  if (moment >= swim.time[last]) pause(); else requestAnimationFrame(step);
}

function pause() {
  playing = false;
  play.textContent = 'Play';
}

play.addEventListener('click', () => {
  if (playing) return pause();
  playing = true;
  play.textContent = 'Pause';
  moment = +slider.value === last ? swim.time[0] : swim.time[slider.value];
  before = performance.now();
  requestAnimationFrame(step);
});
slider.addEventListener('input', () => { pause(); show(+slider.value); });
curves.on('plotly_click', event => { pause(); show(frameAt(event.points[0].x)); });
show(0);
