// Copyright 2026 The fret_monitor authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

// Rows of a trace as drawings: what is drawn, and what pointer and keyboard do to it.

import { Axis, h, named, svg } from './dom.js';
import { place } from './trace.js';
import { words } from './words.js';

export const WIDTH = 1000; // units of a drawing; it is as wide as the page lets it be
const HEIGHT = { truth: 20, number: 48 };
const LABEL = 70; // pixels for a time of six digits

// Which steps are drawn, and which are chosen; all lanes share one.
export class View extends EventTarget {
  first = 0;
  count = 40;
  anchor = 0;
  cursor = 0;
  marks = []; // [kind, step]: lines through all lanes

  get low() { return Math.min(this.anchor, this.cursor); }
  get high() { return Math.max(this.anchor, this.cursor); }
  x(step) { return (step - this.first) * WIDTH / this.count; }

  choose(cursor, steps, { extend = false } = {}) {
    this.cursor = Math.max(0, Math.min(steps - 1, cursor));
    if (!extend) this.anchor = this.cursor;
    if (this.cursor < this.first) this.first = this.cursor;
    if (this.cursor >= this.first + this.count) this.first = this.cursor - this.count + 1;
    this.dispatchEvent(new Event('chosen'));
  }

  zoom(factor, steps) {
    const middle = this.first + this.count / 2;
    this.count = Math.max(5, Math.min(steps, Math.round(this.count * factor)));
    this.pan(Math.round(middle - this.count / 2) - this.first, steps);
  }

  pan(by, steps) {
    this.count = Math.min(this.count, steps);
    this.first = Math.max(0, Math.min(steps - this.count, this.first + by));
    this.dispatchEvent(new Event('moved'));
  }
}

// Yield [from, to, value] of the changes that can be seen.
function* seen(changes, view, end) {
  for (const [number, [step, value]] of changes.entries()) {
    const after = number + 1 < changes.length ? changes[number + 1][0] : end;
    if (after > view.first && step < view.first + view.count) {
      yield [Math.max(step, view.first), Math.min(after, view.first + view.count), value];
    }
  }
}

export function truths(changes, view, end, kind) {
  const parts = [];
  for (const [from, to, value] of seen(changes, view, end)) {
    if (value === null) continue;
    const at = view.x(from);
    parts.push(svg('rect', {
      class: `${kind} ${value ? 'is-true' : 'is-false'}`, x: at, width: view.x(to) - at,
      y: kind === 'verdict' || value ? 2 : 14, height: kind === 'verdict' || value ? 16 : 4 }));
  }
  return parts;
}

export function numbers(changes, view, end, scale) {
  let path = '';
  const parts = [];
  for (const [from, to, value] of seen(changes, view, end)) {
    const y = scale(value);
    if (y === null) {
      parts.push(svg('rect', { class: 'no-number', x: view.x(from), y: 0,
        width: view.x(to) - view.x(from), height: HEIGHT.number }));
    } else path += `${path ? 'L' : 'M'}${view.x(from)} ${y}L${view.x(to)} ${y}`;
  }
  return [...parts, svg('path', { class: 'curve', d: path })];
}

// The least and the greatest value, with room around them.
function extent(input, changes) {
  const values = changes.map(([, value]) => asNumber(input, value)).filter(Number.isFinite);
  const others = input.names.length ? [0, input.names.length - 1] : input.levels ?? [];
  const least = Math.min(...values, ...others);
  const greatest = Math.max(...values, ...others);
  if (!Number.isFinite(least)) return [-1, 1];
  const room = (greatest - least) / 4 || Math.max(1, Math.abs(least) / 2);
  return [least - room, greatest + room];
}

function asNumber(input, value) {
  return typeof value === 'string' && input.names.includes(value) ? input.names.indexOf(value)
    : Number(value);
}

// One row: its drawing, and how it is changed by pointer and keyboard.
export class Lane {
  // `isWaiting()`: whether what is to be drawn is still computed.
  constructor(name, view, { input = null, changes, end, set = null, steps, enter = null,
    isWaiting = () => false }) {
    Object.assign(this, { name, view, input, changes, end, set, steps, enter, isWaiting });
    this.height = input && !input.isBool ? HEIGHT.number : HEIGHT.truth;
    this.axis = input && !input.isBool && !input.names.length ? new Axis() : null;
    this.label = named(name, this.axis);
    this.picture = svg('svg', {
      class: 'lane', viewBox: `0 0 ${WIDTH} ${this.height}`, preserveAspectRatio: 'none',
      height: this.height, tabindex: 0, role: 'slider', 'aria-label': words.laneLabel(name),
      'aria-valuemin': 0, 'aria-valuenow': 0,
      onpointerdown: (event) => this.#down(event), onpointermove: (event) => this.#move(event),
      onpointerup: (event) => this.#up(event), onkeydown: (event) => this.#key(event) });
  }

  isSeen = false; // what is far from the window is not drawn
  #chosen = svg('rect', { class: 'chosen', y: 0 });
  #shown = []; // what the drawing is of

  // Draw what has changed.
  draw() {
    const { view, input } = this;
    this.#choose();
    const changes = this.changes();
    const now = [changes, this.end(), view.first, view.count, view.marks];
    if (now.every((each, number) => each === this.#shown[number])) return;
    this.#shown = now;
    const parts = input && !input.isBool ? numbers(changes, view, this.end(), this.#scale())
      : truths(changes, view, this.end(), input ? 'truth' : 'verdict');
    const marks = view.marks.map(([kind, step]) => svg('line', {
      class: kind, x1: view.x(step), x2: view.x(step), y1: 0, y2: this.height }));
    this.picture.replaceChildren(this.#chosen, ...this.#levels(), ...parts, ...marks);
    if (this.axis && changes.length) this.axis.show(...this.#ends);
  }

  #choose() {
    const { view, picture } = this;
    const [at, to] = [view.x(view.low), view.cursor];
    const set = (element, name, value) => {
      if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
    };
    set(this.#chosen, 'x', at);
    set(this.#chosen, 'width', view.x(view.high + 1) - at);
    set(this.#chosen, 'height', this.height);
    set(picture, 'aria-valuemax', this.steps() - 1);
    set(picture, 'aria-valuenow', to);
    set(picture, 'aria-valuetext', `${words.step} ${to}: ${this.text(to)}`);
  }

  text(step) {
    if (this.isWaiting()) return words.judging;
    const found = this.#changeAt(step);
    if (!found) return words.notJudged;
    if (!this.input) return found[1] ? words.satisfied : words.violated;
    const [, value, comparison] = found; // of a margin: which comparison decides
    return this.input.isBool ? words.truth(value) : [value, comparison].filter(
      (each) => each !== undefined && each !== '').join(' ');
  }

  #changeAt(step) {
    const changes = this.changes();
    const found = changes[place(changes, step)];
    return found && found[0] <= step ? found : undefined;
  }

  get #ends() { return this.#extent ?? extent(this.input, this.changes()); }

  // The numbers with which an input is compared.
  #levels() {
    const scale = this.input?.levels?.length ? this.#scale() : null;
    return scale === null ? [] : this.input.levels.map((level) => svg('line', {
      class: 'level', x1: 0, x2: WIDTH, y1: scale(level), y2: scale(level) }));
  }

  #scale() {
    const [least, greatest] = this.#ends;
    return (value) => {
      const number = asNumber(this.input, value);
      return Number.isFinite(number)
        ? this.height * (greatest - number) / (greatest - least) : null;
    };
  }

  #extent = null; // while a value is drawn, the scale stays
  #drawn = null;

  #step(event) {
    const box = this.picture.getBoundingClientRect();
    const { first, count } = this.view;
    return first + Math.floor((event.clientX - box.left) / box.width * count);
  }

  #value(event) {
    const box = this.picture.getBoundingClientRect();
    const [least, greatest] = this.#extent;
    const part = Math.max(0, Math.min(1, (event.clientY - box.top) / box.height));
    const number = greatest - part * (greatest - least);
    const { input } = this;
    if (input.names.length) {
      return input.names[Math.max(0, Math.min(input.names.length - 1, Math.round(number)))];
    }
    return input.isFloat ? Number(number.toPrecision(2)) : Math.round(number);
  }

  #down(event) {
    const step = this.#step(event);
    this.view.choose(step, this.steps(), { extend: event.shiftKey });
    if (!this.set || event.shiftKey) return;
    this.picture.setPointerCapture(event.pointerId);
    this.#extent = this.input.isBool ? null : extent(this.input, this.changes());
    this.#drawn = { step, value: this.input.isBool ? this.#at(step) !== true : null, moved: false };
    if (this.input.isBool) this.set(step, step, this.#drawn.value);
  }

  #at(step) { return this.#changeAt(step)?.[1]; }

  #move(event) {
    if (!this.#drawn) return;
    const step = Math.max(0, Math.min(this.steps() - 1, this.#step(event)));
    if (step === this.#drawn.step && !this.#drawn.moved && this.input.isBool) return;
    const last = this.#drawn.moved ? this.#drawn.step : this.view.anchor;
    this.#drawn.moved = true;
    const value = this.input.isBool ? this.#drawn.value : this.#value(event);
    this.set(Math.min(step, last), Math.max(step, last), value);
    this.#drawn.step = step;
    this.view.choose(step, this.steps(), { extend: true });
  }

  #up() {
    this.#drawn = null;
    this.#extent = null;
    this.#shown = [];
    this.draw();
  }

  #key(event) {
    const { view } = this;
    const far = Math.max(1, Math.round(view.count / 10));
    const to = {
      ArrowLeft: view.cursor - 1, ArrowRight: view.cursor + 1, PageUp: view.cursor - far,
      PageDown: view.cursor + far, Home: 0, End: this.steps() - 1 }[event.key];
    if (to !== undefined) view.choose(to, this.steps(), { extend: event.shiftKey });
    else if (event.key === ' ' && this.set && this.input.isBool) {
      this.set(view.low, view.high, this.#at(view.cursor) !== true);
    } else if (event.key === 'Enter' && this.enter) this.enter();
    else return;
    event.preventDefault();
  }
}

// Return labels for a width in pixels: as many as have room.
export function scale(view, seconds, width) {
  const marks = [];
  const every = niceStep(view.count / Math.max(1, Math.min(8, width / LABEL)));
  for (let step = Math.ceil(view.first / every) * every; step < view.first + view.count;
    step += every) {
    const left = `${(step - view.first) / view.count * 100}%`;
    const mark = h('span', {}, seconds ? `${Number((step * seconds).toPrecision(6))} s`
      : String(step));
    mark.style.left = left;
    marks.push(mark);
  }
  return marks;
}

function niceStep(size) {
  const power = 10 ** Math.floor(Math.log10(Math.max(1, size)));
  return Math.max(1, [1, 2, 5, 10].map((each) => each * power).find((each) => each >= size));
}
