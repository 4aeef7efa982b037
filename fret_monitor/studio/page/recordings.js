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

// Recordings of the folder: the report of one, or of a stretch of it.

import { h, show } from './dom.js';
import { report } from './report.js';
import { OUTDATED } from './talk.js';
import { words } from './words.js';

const AROUND = 0.02; // of a recording, on each side of an occurrence
const LEAST_S = 0.001; // of a stretch

export class Recordings {
  #ask;
  #take;
  #found = null;
  #place = 0; // of the occurrence that was shown last, in all
  #stretch = null; // seconds; null: all
  #parts;

  // `ask` as of the editor; `take(trace, note)` takes a stretch over.
  constructor(place, ask, take) {
    this.#ask = ask;
    this.#take = take;
    const button = (label, run, id) => h('button', { type: 'button', onclick: run, id }, label);
    const seconds = (id) => h('input', { type: 'number', min: 0, step: 'any', id });
    const [from, to] = [seconds('stretch-from'), seconds('stretch-to')];
    this.#parts = {
      from, to,
      names: h('select', { id: 'recording' }),
      note: h('p', { role: 'status', id: 'recording-note' }),
      body: h('div', { id: 'report' }),
      tools: h('div', { class: 'tools', hidden: true },
        button(words.previous, () => this.#step(-1), 'previous'),
        button(words.next, () => this.#step(1), 'next'),
        h('label', {}, words.from, ' ', from), h('label', {}, words.to, ' ', to),
        button(words.zoom, () => this.#zoomTo(Number(from.value), Number(to.value)), 'zoom'),
        button(words.zoomIn, () => this.#scale(0.5)), button(words.zoomOut, () => this.#scale(2)),
        button(words.earlier, () => this.#pan(-0.5)), button(words.later, () => this.#pan(0.5)),
        button(words.all, () => this.#open(null), 'all'),
        button(words.takeOver, () => this.#takeOver(), 'take-over')),
    };
    const { names, note, body, tools } = this.#parts;
    this.#parts.choice = h('div', { class: 'tools' }, h('label', {}, words.recording, ' ', names),
      button(words.open, () => this.#open(null), 'open-recording'));
    show(place, this.#parts.choice, tools, note, body);
    this.list([]);
  }

  list(names) {
    const { value } = this.#parts.names;
    show(this.#parts.names, ...names.map((name) => h('option', { value: name }, name)));
    this.#parts.choice.hidden = !names.length;
    if (names.includes(value)) this.#parts.names.value = value;
    if (!names.length) this.#tell(words.noRecordings);
    else if (this.#parts.note.textContent === words.noRecordings) this.#tell('');
  }

  get #window() {
    return this.#stretch ?? [0, this.#found.length];
  }

  async #open(stretch) {
    const { names, body, tools, from, to } = this.#parts;
    if (!names.value) return false;
    this.#tell(words.openingRecording);
    try {
      const found = await this.#ask('recording', {
        recording: names.value, from: stretch?.[0], to: stretch?.[1] });
      this.#found = found;
      this.#stretch = stretch;
      tools.hidden = false;
      [from.value, to.value] = this.#window.map((each) => Number(each.toPrecision(9)));
      const drawn = report(found.html, found.data);
      drawn.addEventListener('pointerdown', (event) => this.#drag(drawn, event));
      show(body, drawn);
      this.#tell(words.occurrences(found.occurrences.length));
      return true;
    } catch (error) {
      if (error.message !== OUTDATED) this.#tell(error.message);
      return false;
    }
  }

  #zoomTo(first, last) {
    const least = Math.max(LEAST_S, this.#found.length * 1e-6);
    const from = Math.max(0, Math.min(first, this.#found.length - least));
    return this.#open([from, Math.max(from + least, Math.min(last, this.#found.length))]);
  }

  #scale(factor) {
    const [first, last] = this.#window;
    const [middle, half] = [(first + last) / 2, (last - first) / 2 * factor];
    return this.#zoomTo(middle - half, middle + half);
  }

  #pan(part) {
    const [first, last] = this.#window;
    const by = Math.max(-first, Math.min(part * (last - first), this.#found.length - last));
    return this.#zoomTo(first + by, last + by);
  }

  // Drag over a row: zoom to that stretch.
  #drag(drawn, event) {
    const row = event.composedPath()[0].closest?.('svg[data-lane], svg[data-input]');
    if (!row) return;
    const box = row.getBoundingClientRect();
    const at = (place) => Math.max(0, Math.min(1, (place.clientX - box.left) / box.width));
    const [first, last] = this.#window;
    addEventListener('pointerup', (end) => {
      const parts = [at(event), at(end)].sort((a, b) => a - b);
      if ((parts[1] - parts[0]) * box.width < 6) return;
      this.#zoomTo(...parts.map((part) => first + part * (last - first)));
    }, { once: true });
  }

  // Show the occurrence before or after the one that was shown last.
  async #step(by) {
    const all = this.#found.occurrences;
    if (!all.length) return;
    this.#place = this.#shown === null ? (by > 0 ? 0 : all.length - 1)
      : (this.#place + by + all.length) % all.length;
    const [at, id] = all[this.#place];
    const around = Math.max(LEAST_S, this.#found.length * AROUND);
    if (this.#drawnPlace(at, id) < 0 && !await this.#zoomTo(at - around, at + around)) return;
    this.#shown = id;
    const place = this.#drawnPlace(at, id);
    const figure = this.#parts.body.firstChild.shadowRoot.querySelector(
      `svg[data-occurrence="${place}"]`)?.parentNode;
    if (figure) {
      figure.tabIndex = -1;
      figure.focus();
      figure.scrollIntoView({ block: 'center' });
    }
    this.#tell(words.occurrence(this.#place + 1, all.length, id, at));
  }

  #shown = null;

  #drawnPlace(at, id) {
    return this.#found.drawn.findIndex(([time, name]) => time === at && name === id);
  }

  async #takeOver() {
    const [from, to] = [Number(this.#parts.from.value), Number(this.#parts.to.value)];
    this.#tell(words.openingRecording);
    try {
      const found = await this.#ask('taken', { recording: this.#parts.names.value, from, to });
      this.#tell('');
      this.#take(found, [
        found.period ? words.takenEvenly(found.steps, found.period) : words.taken(found.steps),
        found.late.length ? words.late(found.late) : ''].filter(Boolean).join(' '));
    } catch (error) {
      this.#tell(error.message);
    }
  }

  #tell(text) {
    this.#parts.note.textContent = text;
  }
}
