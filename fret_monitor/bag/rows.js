'use strict';

// Draws the lanes and plots of a report from its data: `drawReport(root, data)`. A lane is a text
// such as t40m1f3: 40 parts true, 1 both, 3 false, also u unknown and o open. The values of an
// input in a part are [part, least, most, last], or [part, last] if they are equal; "NaN" comes before them.
// An input holds its last value until the next part that has one.

const NAMESPACE = 'http://www.w3.org/2000/svg';
const PLOT = 64;

function add(parent, name, attributes, text) {
  const node = document.createElementNS(NAMESPACE, name);
  for (const key in attributes) {
    node.setAttribute(key, attributes[key]);
  }
  if (text !== undefined) {
    node.textContent = text;
  }
  return parent.appendChild(node);
}

function runs(text) {
  return Array.from(text.matchAll(/([a-z])(\d+)/g), (item) => [item[1], Number(item[2])]);
}

function total(text) {
  return runs(text).reduce((sum, item) => sum + item[1], 0);
}

// The state of a lane at a part of its width, 0 to 1.
function stateAt(text, at) {
  const part = Math.floor(at * total(text));
  let place = 0;
  for (const [state, length] of runs(text)) {
    place += length;
    if (part < place) {
      return state;
    }
  }
  return 'u';
}

const VERDICT = {t: 'good', f: 'bad', m: 'bad', u: 'none', o: 'open'};
const TRUTH = {t: 'true', f: 'false', m: 'true', u: 'none', o: 'open'};
const FIRED = {t: 'fired', f: 'false', m: 'fired', u: 'none', o: 'open'};
const KINDS = {verdict: VERDICT, proposition: TRUTH, trigger: FIRED};
const WORDS = {
  verdict: {t: 'fulfilled', f: 'violated', m: 'both', u: 'not judged', o: 'open'},
  proposition: {t: 'true', f: 'false', m: 'both', u: 'not known', o: 'open'},
  trigger: {t: 'triggered', f: 'no', m: 'triggered', u: 'not known', o: 'open'},
};

function drawLane(svg, text, kind, width, y, height) {
  const step = width / total(text);
  const found = [];
  let place = 0;
  for (const [state, length] of runs(text)) {
    found.push([state, place * step, length * step]);
    place += length;
  }
  const band = (name, x, length, part) => add(svg, 'rect', {
    class: name, x: x.toFixed(2), width: length.toFixed(2),
    y: y + height * (1 - part) / 2, height: height * part});
  // What may be short comes last and is at least two pixels wide, so that nothing hides it.
  const isBackground = (state) => state === 'u' || state === (kind === 'verdict' ? 't' : 'f');
  for (const [state, x, length] of found.filter((item) => isBackground(item[0]))) {
    band(KINDS[kind][state], x, length, state === 'u' ? 0.4 : 1);
  }
  for (const [state, x, length] of found.filter((item) => !isBackground(item[0]))) {
    const isMixed = state === 'm' && kind === 'proposition';
    band(isMixed ? 'false' : KINDS[kind][state], x, Math.max(2, length), 1);
    if (isMixed) {
      band('true', x, Math.max(2, length), 0.5);
    }
    if (kind === 'trigger' && state !== 'o' && length < 8) {  // as an arrow: it may be one instant
      const at = Math.max(5, Math.min(width - 5, x + length / 2));
      add(svg, 'path', {class: 'fired', d: `M${at - 5} ${y}h10l-5 ${height}z`});
    }
  }
}

function number(value) {
  return typeof value === 'string' ? Number(value.replace('inf', 'Infinity')) : value;
}

function shown(input, value) {
  if (value === null || value === undefined) {
    return 'none yet';
  }
  const given = number(value);
  const name = input.names && input.names.find((item) => item[1] === given);
  if (name) {
    return name[0];
  }
  return input.bool ? String(given !== 0) : String(given);
}

function shortened(input, value) {
  return shown(input, Number.isInteger(value) ? value : Number(value.toPrecision(4)));
}

// The values of a part; the one that holds if none came in it.
function valuesAt(plot, part) {
  let low = 0;
  let high = plot.v.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (plot.v[middle][0] <= part) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  const item = plot.v[low - 1];
  if (item === undefined) {
    return [plot.b];
  }
  return item[0] === part ? item.slice(1) : item.slice(-1);
}

function extent(plot) {
  const all = [plot.b, ...(plot.h || []).map((item) => item[0])];
  for (const item of plot.v) {
    all.push(...item.slice(1));
  }
  const finite = all.filter((value) => value !== null).map(number).filter(Number.isFinite);
  let least = finite.length ? finite.reduce((a, b) => Math.min(a, b)) : 0;
  let most = finite.length ? finite.reduce((a, b) => Math.max(a, b)) : 1;
  const real = [least, most];
  const margin = (most - least) * 0.08 || Math.abs(most) * 0.08 || 0.5;
  least -= margin;
  most += margin;
  return {least, most, real};
}

// Heights of labels, moved apart so that none covers another.
function spread(heights, least, most) {
  const order = heights.map((_, k) => k).sort((a, b) => heights[a] - heights[b]);
  const found = heights.slice();
  order.forEach((k, place) => {
    found[k] = place ? Math.max(found[k], found[order[place - 1]] + 12) : Math.max(found[k], least);
  });
  let limit = most;
  for (const k of order.reverse()) {
    found[k] = Math.min(found[k], limit);
    limit = found[k] - 12;
  }
  return found;
}

function drawPlot(svg, input, plot, parts, width, y) {
  const {least, most, real} = extent(plot);
  const place = (value) => {
    const at = y + PLOT * (1 - (number(value) - least) / (most - least));
    return Math.max(y, Math.min(y + PLOT, at));
  };
  add(svg, 'rect', {class: 'box', x: 0.5, y: y + 0.5, width: width - 1, height: PLOT - 1});
  for (const [value] of plot.h || []) {
    add(svg, 'line', {class: 'limit', x1: 0, x2: width, y1: place(value), y2: place(value)});
  }
  const step = width / parts;
  let path = '';
  let held = plot.b;
  let isDrawn = false;
  const hold = (x) => {
    if (held === null || Number.isNaN(number(held))) {
      isDrawn = false;
      return;
    }
    path += isDrawn ? `H${x.toFixed(1)}` : '';
  };
  const go = (x, value) => {
    if (value === null || Number.isNaN(number(value))) {
      isDrawn = false;
      add(svg, 'circle', {class: 'nan', cx: x, cy: y + PLOT / 2, r: 2});
      return;
    }
    path += `${isDrawn ? 'L' : 'M'}${x.toFixed(1)} ${place(value).toFixed(1)}`;
    isDrawn = true;
  };
  if (held !== null) {
    go(0, held);
  }
  for (const item of plot.v) {
    const x = item[0] * step;
    hold(x);
    item.slice(1).forEach((value, k, all) => {
      if (k === 0 || value !== all[k - 1]) {
        go(x, value);
      }
    });
    held = item[item.length - 1];
  }
  hold(width);
  add(svg, 'path', {class: 'curve', d: path});
  const heights = spread((plot.h || []).map(([value]) =>
    (place(value) < y + 14 ? place(value) + 12 : place(value) - 3)), y + 11, y + PLOT - 4);
  (plot.h || []).forEach(([, label], k) => {
    add(svg, 'text', {class: 'limit inside end', x: width - 4, y: heights[k]}, label);
  });
  if (real[0] !== real[1]) {
    add(svg, 'text', {class: 'inside', x: 4, y: y + 12}, shortened(input, real[1]));
  }
  add(svg, 'text', {class: 'inside', x: 4, y: y + PLOT - 4}, shortened(input, real[0]));
}

// Times on an axis of `length` nanoseconds that begins `begin` after zero. Of a trace without
// times, the `unit` is not a second but a step.
function drawAxis(svg, begin, length, width, y, unit = 's') {
  const wanted = Math.max(unit === 's' ? 0 : 1e9, length / Math.max(2, width / 90));
  const power = 10 ** Math.floor(Math.log10(wanted));
  const step = [1, 2, 5, 10].map((item) => item * power).find((item) => item >= wanted);
  for (let k = Math.ceil(begin / step); k * step <= begin + length; k += 1) {
    const x = (k * step - begin) / length * width;
    add(svg, 'line', {class: 'tick', x1: x, x2: x, y1: y, y2: y + 4});
    const kind = x < 20 ? '' : x > width - 30 ? 'end' : 'middle';
    add(svg, 'text', {class: kind, x: x < 20 ? 0 : x > width - 30 ? width : x, y: y + 16},
      `${Number((k * step / 1e9).toPrecision(12))} ${unit}`);
  }
}

function start(svg) {
  svg.replaceChildren();
  return Math.max(240, Math.round(svg.parentNode.clientWidth < svg.clientWidth ?
    svg.parentNode.clientWidth : svg.clientWidth || svg.parentNode.clientWidth));
}

function finish(svg, width, height) {
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
}

// Shows values under the pointer: `show` takes the part of the width, or null.
function follow(svg, width, height, show) {
  const cursor = add(svg, 'line', {class: 'cursor', y1: 0, y2: height, visibility: 'hidden'});
  svg.onpointermove = (event) => {
    const box = svg.getBoundingClientRect();
    const part = Math.max(0, Math.min(0.999999, (event.clientX - box.left) / box.width));
    cursor.setAttribute('x1', part * width);
    cursor.setAttribute('x2', part * width);
    cursor.setAttribute('visibility', 'visible');
    show(part);
  };
  svg.onpointerdown = svg.onpointermove;
  svg.onpointerleave = () => {
    cursor.setAttribute('visibility', 'hidden');
    show(null);
  };
}

function inSeconds(time, unit = 's') {
  if (time < 1000) {
    return `${time} ns`;
  }
  return `${Number((time / 1e9).toPrecision(6))} ${unit}`;
}

function drawOverview(svg, data) {
  const width = start(svg);
  drawLane(svg, data.lanes[Number(svg.dataset.lane)], 'verdict', width, 0, 16);
  finish(svg, width, 16);
}

function drawTimes(svg, data) {
  const width = start(svg);
  drawAxis(svg, data.begin, Math.max(1, data.length), width, 0);
  finish(svg, width, 20);
}

function drawInput(svg, data) {
  const width = start(svg);
  const input = data.inputs[Number(svg.dataset.input)];
  add(svg, 'text', {class: 'name', x: 0, y: 12}, input.name);
  const value = add(svg, 'text', {class: 'value', x: width, y: 12}, '');
  drawPlot(svg, input, input, input.n, width, 18);
  drawAxis(svg, data.begin, Math.max(1, data.length), width, 18 + PLOT);
  finish(svg, width, 40 + PLOT);
  follow(svg, width, 18 + PLOT, (part) => {
    value.textContent = part === null ? '' :
      `${range(input, valuesAt(input, Math.floor(part * input.n)))} at ` +
      `${Number(((data.begin + part * data.length) / 1e9).toPrecision(6))} s`;
  });
}

function range(input, values) {
  const isNumber = (value) => value !== null && !Number.isNaN(number(value));
  const numbers = values.filter(isNumber).sort((a, b) => number(a) - number(b));
  if (numbers.length === 0) {
    return shown(input, values[0]);
  }
  const least = shown(input, numbers[0]);
  const most = shown(input, numbers[numbers.length - 1]);
  return (least === most ? least : `${least} … ${most}`) +
    (numbers.length < values.length ? ', NaN' : '');
}

function drawOccurrence(svg, data) {
  const width = start(svg);
  const item = data.occurrences[Number(svg.dataset.occurrence)];
  const [begin, end] = item.w;
  const length = Math.max(1, end - begin);
  const values = [];
  const marks = item.o ? [] : [[0, 'violated', item.d ? 'deadline, violated' : 'violated']];
  if (item.g !== null && item.g >= begin && (item.g < 0 || item.o)) {
    marks.unshift([item.g, 'trigger', 'trigger']);
  }
  if (item.e !== null && item.e <= end) {
    marks.push([item.e, 'over', 'over']);
  }
  let y = 14 * Math.max(1, marks.length) + 4;
  for (const plot of item.p) {
    const input = data.inputs[plot.i];
    add(svg, 'text', {class: 'name', x: 0, y: y + 11}, input.name);
    const value = add(svg, 'text', {class: 'value', x: width, y: y + 11}, '');
    values.push([value, (part) =>
      range(input, valuesAt(plot, Math.floor(part * item.n)))]);
    drawPlot(svg, input, plot, item.n, width, y + 16);
    y += PLOT + 22;
  }
  for (const [label, kind, lane] of item.l) {
    const shownLabel = kind === 'trigger' ? `trigger: ${label}` : label;
    const most = Math.floor(width / 6.2) - 10;
    add(svg, 'text', {class: 'name', x: 0, y: y + 11},
      shownLabel.length > most ? `${shownLabel.slice(0, most)}…` : shownLabel);
    const value = add(svg, 'text', {class: 'value', x: width, y: y + 11}, '');
    values.push([value, (part) => WORDS[kind][stateAt(lane, part)]]);
    drawLane(svg, lane, kind, width, y + 15, 10);
    y += 29;
  }
  marks.forEach(([time, kind, label], row) => {
    const x = (time - begin) / length * width;
    add(svg, 'line', {class: kind, x1: x, x2: x, y1: 14 * row + 4, y2: y});
    const isLeft = x > width - 130;
    add(svg, 'text', {class: `${kind} ${isLeft ? 'end' : ''}`, x: isLeft ? x - 5 : x + 5,
      y: 14 * row + 12}, time === 0 ? label : `${label} ${time < 0 ? '−' : '+'}` +
      `${inSeconds(Math.abs(time), data.unit)}`);
  });
  svg.querySelectorAll('text.name, text.value').forEach((node) => svg.append(node));  // over marks
  drawAxis(svg, begin, length, width, y, data.unit);
  const at = add(svg, 'text', {class: 'value', x: width, y: 11}, '');
  finish(svg, width, y + 20);
  follow(svg, width, y, (part) => {
    at.textContent = part === null ? '' :
      `${Number(((begin + part * length) / 1e9).toPrecision(6))} ${data.unit ?? 's'}`;
    values.forEach(([node, text]) => {
      node.textContent = part === null ? '' : text(part);
    });
  });
}

// Draw all that is below a node of a page.
function drawReport(root, data) {
  const drawings = {
    'data-lane': drawOverview, 'data-times': drawTimes, 'data-input': drawInput,
    'data-occurrence': drawOccurrence};
  for (const [name, draw] of Object.entries(drawings)) {
    root.querySelectorAll(`svg[${name}]`).forEach((svg) => draw(svg, data));
  }
}
