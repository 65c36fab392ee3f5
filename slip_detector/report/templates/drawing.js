// Colours, elements and drawings of intervals of time, for the report and the live page.

const ON = '#d55e00', GROUP_ON = '#e58a4e', TRUTH = '#b9d7ec', LABEL = '#7fb2d6';
const INK = '#23292e';
// Height in pixels of the strip under a curve that shows how near its channel is to the threshold.
const STRIP = 4;
// Levels are shown from 1/32 to 32 times the threshold.
const LEVEL_OCTAVES = 5;

const element = (id) => document.getElementById(id);

// An element of a tag with classes, as 'p.hint'; parts: texts and elements in it, properties.
function build(kind, ...parts) {
  const [name, ...classes] = kind.split('.'), made = document.createElement(name);
  made.className = classes.join(' ');
  for (const part of parts) {
    if (typeof part === 'string' || part instanceof Node) made.append(part);
    else {
      const {dataset, ...properties} = part;
      Object.assign(made, properties);
      Object.assign(made.dataset, dataset);
    }
  }
  return made;
}

// Call act(event) for each event of these types, as 'keydown keyup', at a target or its id.
function listen(target, types, act, options) {
  const place = typeof target === 'string' ? element(target) : target;
  for (const type of types.split(' ')) place.addEventListener(type, act, options);
}

// Whether a key is pressed for the browser or the system.
const isShortcut = ({ctrlKey, altKey, metaKey}) => ctrlKey || altKey || metaKey;

// Fit a canvas to its size on the page; returns its context, in CSS pixels, and that size.
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1, {clientWidth: width, clientHeight: height} = canvas;
  Object.assign(canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  return {context, width, height};
}

// Shades of levels below the threshold, darker towards it: few, which need fewer rectangles.
const SHADES = Array.from({length: 2 * LEVEL_OCTAVES + 1}, (_, i) => {
  const near = i / (2 * LEVEL_OCTAVES);
  return `rgb(${[95, 109, 119].map((dark) => Math.round(238 + (dark - 238) * near)).join()})`;
});

// The colour of a level, given its octaves above the threshold (below 0: under it).
function shade(octaves) {
  return octaves > 0 ? ON : SHADES[Math.max(0, 2 * LEVEL_OCTAVES + Math.floor(2 * octaves))];
}

// The pattern of what is not valid.
const hatch = build('canvas', {width: 4, height: 4}).getContext('2d');
hatch.strokeStyle = '#999';
hatch.stroke(new Path2D('M0 4 L4 0'));
const HATCHING = hatch.createPattern(hatch.canvas, 'repeat');

// Fill intervals of time. times: their starts and stops, alternately.
function bars(context, xOf, times, top, height, color) {
  context.fillStyle = color;
  for (let i = 0; i < times.length; i += 2) {
    const from = xOf(times[i]);
    context.fillRect(from, top, Math.max(xOf(times[i + 1]) - from, 1), height);
  }
}

// Paint the values from first up to stop, neighbours of the same colour as one; null: no colour.
function paintRuns(context, top, height, first, stop, colorAt, xOf) {
  let start = first, color = null;
  const fill = (i) => {
    if (color === null || i === start) return;
    const x = xOf(start);
    context.fillStyle = color;
    context.fillRect(x, top, Math.max(xOf(i) - x, 1), height);
  };
  for (let i = first; i < stop; i++) {
    const next = colorAt(i);
    if (next === color) continue;
    fill(i);
    [start, color] = [i, next];
  }
  fill(stop);
}
