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

// A trace that is drawn, and the verdicts of all requirements on it.

import { h, show } from './dom.js';
import { Lane, scale, View } from './lanes.js';
import { MOST, parsed, readCsv, Trace } from './trace.js';
import { words } from './words.js';

export class Tryout {
  #place;
  #ask;
  #bundle = null;
  #trace = new Trace();
  #view = new View();
  #verdicts = {};
  #lanes = [];
  #active = null; // the input whose value is typed
  #parts = {};

  // `ask` as of the editor, with the bundle in the question.
  constructor(place, ask) {
    this.#place = place;
    this.#ask = ask;
    this.#view.addEventListener('chosen', () => this.#draw());
    this.#view.addEventListener('moved', () => this.#draw());
  }

  // Show the inputs of another version of the bundle.
  use(bundle) {
    const before = JSON.stringify([this.#bundle?.inputs, this.#bundle?.requirements.map(
      (item) => item.id), this.#bundle?.isTimed]);
    this.#bundle = bundle;
    this.#trace.fit(bundle.inputs);
    if (before !== JSON.stringify([bundle.inputs, bundle.requirements.map((item) => item.id),
      bundle.isTimed])) this.#build();
    this.#judge();
  }

  get #seconds() {
    return this.#bundle.isTimed ? this.#trace.period : this.#bundle.period;
  }

  #build() {
    const { inputs, requirements } = this.#bundle;
    const steps = () => this.#trace.steps;
    const lane = (input) => new Lane(input.name, this.#view, {
      input, steps, end: steps, changes: () => this.#trace.values[input.name],
      set: (first, last, value) => this.#set(input, first, last, value),
      enter: () => this.#parts.value.focus() });
    const verdict = (item) => new Lane(item.id, this.#view, {
      steps, end: steps, changes: () => this.#asSteps(this.#verdicts[item.id] ?? []) });
    const above = inputs.map(lane);
    const below = requirements.map(verdict);
    this.#lanes = [...above, ...below];
    above.forEach((each, number) => each.picture.addEventListener('focus', () => {
      this.#active = inputs[number];
      this.#draw();
    }));
    this.#active = inputs.find((item) => item.name === this.#active?.name) ?? inputs[0] ?? null;
    this.#parts = this.#controls();
    show(this.#place,
      h('p', { class: 'faint' }, words.drawing), this.#parts.tools,
      h('div', { class: 'rows' },
        ...above.flatMap((each) => this.#row(each)), h('span'), this.#parts.scale, h('span'),
        ...below.flatMap((each) => this.#row(each))),
      this.#parts.typed, this.#parts.examples, this.#parts.note);
    this.#draw();
  }

  #row(lane) {
    lane.shown = h('output', { class: lane.input ? 'now' : 'now verdict' });
    return [h('span', { class: 'name', title: lane.name }, lane.name), lane.picture, lane.shown];
  }

  #controls() {
    const { requirements, isTimed } = this.#bundle;
    const button = (label, run) => h('button', { type: 'button', onclick: run }, label);
    const zoom = (factor) => () => this.#view.zoom(factor, this.#trace.steps);
    const pan = (part) => () => this.#view.pan(
      Math.round(part * this.#view.count), this.#trace.steps);
    const steps = h('input', {
      type: 'number', min: 1, max: MOST, value: this.#trace.steps, id: 'steps',
      onchange: () => this.#resize(Number(steps.value)) });
    const period = h('input', {
      type: 'number', min: 0, step: 'any', value: this.#trace.period, id: 'period',
      onchange: () => {
        if (Number(period.value) > 0) this.#trace.period = Number(period.value);
        this.#draw();
        this.#judge();
      } });
    const value = h('input', {
      id: 'value', size: 10, list: 'names', autocomplete: 'off',
      onkeydown: (event) => { if (event.key === 'Enter') this.#type(value.value); } });
    const names = h('datalist', { id: 'names' });
    const file = h('input', {
      type: 'file', accept: '.csv,text/csv', hidden: true, id: 'csv-file',
      onchange: () => this.#import(file) });
    const options = (others) => others.map((item) => h('option', { value: item.id }, item.id));
    const chosen = h('select', { id: 'example-of', 'aria-label': words.requirement },
      ...options(requirements));
    const other = h('select', { id: 'other', 'aria-label': words.apart },
      ...options(requirements));
    if (requirements.length > 1) other.value = requirements[1].id;
    const show_ = (kind) => () => this.#example([chosen.value], kind);
    return {
      steps, period, value, names,
      selection: h('span', { class: 'faint', id: 'chosen' }),
      valueLabel: h('label', { for: 'value' }),
      scale: h('div'),
      note: h('p', { role: 'status', id: 'trace-note' }),
      tools: h('div', { class: 'tools' },
        h('label', {}, words.steps, ' ', steps),
        isTimed ? h('label', {}, words.period, ' ', period) : null,
        button(words.zoomIn, zoom(0.5)), button(words.zoomOut, zoom(2)),
        button(words.earlier, pan(-0.5)), button(words.later, pan(0.5)),
        button(words.exportCsv, () => this.#export()),
        button(words.importCsv, () => file.click()), file),
      typed: h('div', { class: 'tools' }),
      examples: requirements.length ? h('div', { class: 'tools' },
        h('label', {}, words.requirement, ' ', chosen), h('span', {}, words.example),
        ...Object.entries(words.kinds).map(([kind, label]) => button(label, show_(kind))),
        requirements.length > 1 ? button(words.apart, () => this.#example(
          [chosen.value, other.value], 'violating')) : null,
        requirements.length > 1 ? other : null) : null,
    };
  }

  #draw() {
    if (!this.#bundle) return;
    const { low, high, cursor } = this.#view;
    for (const lane of this.#lanes) {
      lane.draw();
      lane.shown.textContent = lane.text(cursor);
      if (!lane.input) {
        lane.shown.className = `now verdict ${{ [words.satisfied]: 'is-true',
          [words.violated]: 'is-false' }[lane.text(cursor)] ?? ''}`;
      }
    }
    const parts = this.#parts;
    const marks = scale(this.#view, this.#seconds);
    parts.scale.replaceWith(marks);
    parts.scale = marks;
    const time = this.#seconds ? `, ${Number((cursor * this.#seconds).toPrecision(9))} s` : '';
    parts.selection.textContent = words.chosen(low, high, time);
    const active = this.#active;
    if (!active) return;
    parts.names.replaceChildren(...active.names.map((name) => h('option', { value: name })));
    parts.valueLabel.textContent = `${active.name}: ${words.value}`;
    if (document.activeElement !== parts.value) {
      parts.value.value = String(this.#trace.at(active.name, cursor));
    }
    if (!parts.typed.childElementCount) {
      show(parts.typed, parts.selection, parts.valueLabel, parts.value, parts.names,
        h('button', { type: 'button', onclick: () => this.#type(parts.value.value) }, words.set));
    }
  }

  // Changes of verdicts are at times under `timed`: the step in which they fall.
  #asSteps(changes) {
    if (!this.#bundle.isTimed) return changes;
    return changes.map(([time, value]) => [time / this.#trace.period, value]);
  }

  #type(text) {
    const value = parsed(this.#active, text);
    if (value === undefined) {
      this.#tell(`'${text}' is no value of ${this.#active.name} (${this.#active.type})`);
    } else this.#set(this.#active, this.#view.low, this.#view.high, value);
  }

  #set(input, first, last, value) {
    this.#trace.set(input.name, Math.max(0, first), Math.min(last, this.#trace.steps - 1), value);
    this.#tell('');
    this.#draw();
    this.#judge();
  }

  #resize(steps) {
    this.#trace.resize(steps);
    this.#parts.steps.value = this.#trace.steps;
    this.#view.first = 0;
    this.#view.count = this.#trace.steps;
    this.#view.choose(Math.min(this.#view.cursor, this.#trace.steps - 1), this.#trace.steps);
    this.#judge();
  }

  async #judge(more = {}) {
    const { steps, period, values } = this.#trace;
    try {
      const found = await this.#ask('simulate', { steps, period, values, ...more });
      this.#verdicts = found.verdicts;
      this.#place.dataset.judged = String(Number(this.#place.dataset.judged ?? 0) + 1);
      this.#draw();
      return found;
    } catch (error) {
      if (error.message !== 'outdated') this.#tell(error.message);
      return null;
    }
  }

  async #example(ids, kind) {
    this.#tell(words.reading);
    try {
      const found = await this.#ask('example', { ids, kind });
      if (found.period) this.#trace.period = found.period;
      this.#parts.period.value = this.#trace.period;
      Object.assign(this.#trace.values, found.values);
      this.#resize(found.steps);
      this.#tell('');
    } catch (error) {
      this.#tell(error.message);
    }
  }

  async #export() {
    const found = await this.#judge({ csv: true });
    if (!found) return;
    const link = h('a', {
      href: URL.createObjectURL(new Blob([found.csv], { type: 'text/csv' })),
      download: 'trace.csv' });
    link.click();
    URL.revokeObjectURL(link.href);
  }

  async #import(file) {
    const text = await file.files[0].text();
    file.value = '';
    const notes = readCsv(this.#trace, this.#bundle.inputs, text, words);
    this.#parts.period.value = this.#trace.period;
    this.#resize(this.#trace.steps);
    this.#tell(notes.join('; '));
  }

  #tell(text) {
    if (this.#parts.note) this.#parts.note.textContent = text;
  }
}
