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

// What a requirement means, with examples.

import { h, show, svg } from './dom.js';
import { Form, NewForm } from './form.js';
import { OUTDATED } from './talk.js';
import { words } from './words.js';

const PAUSE_MS = 300; // after a change of the text, before it is explained again
const CELL = 12;
const ROW = 18;

export class Meaning {
  #place;
  #ask;
  #bundle = null;
  #id = null;
  #shownId = null;
  #go;
  #form;
  #new;
  #wanted = null; // what was just written
  #isNew = false; // what is shown is a new requirement
  #add = h('button', { type: 'button', id: 'new-requirement', onclick: () => this.#begin() },
    words.newRequirement);
  #isSentence = false;
  #pause = 0;
  #body = h('div', { 'aria-live': 'polite' });
  #select = h('select', { id: 'requirement' });

  // `go(offset)` shows a place in the editor, `edit` is as of the form.
  constructor(place, ask, go, edit) {
    this.#form = new Form(ask, edit);
    this.#new = new NewForm(ask, edit, (text, id) => this.#explainNew(text, id),
      (id) => this.#end(id));
    this.#place = place;
    this.#ask = ask;
    this.#go = go;
    this.#select.addEventListener('change', () => {
      this.#id = this.#select.value;
      const found = this.#bundle.requirements.find((item) => item.id === this.#id);
      if (found) this.#go(found.from);
      this.#explain();
    });
    this.#showNone();
  }

  #showNone() {
    show(this.#place, h('p', { class: 'faint' }, words.noBundle), this.#add);
  }

  #begin() {
    this.#isNew = true;
    show(this.#place, this.#new.element, this.#body);
    this.#new.begin(this.#form.component);
  }

  // The new requirement is written; null: there is none.
  #end(id) {
    this.#isNew = false;
    this.#wanted = id;
    this.#showNone();
    if (this.#bundle) this.use(this.#bundle);
  }

  async #explainNew(text, id) {
    if (!text) {
      show(this.#body);
      return;
    }
    try {
      const found = await this.#ask('explain', { id, text });
      if (this.#isNew) show(this.#body, ...this.#shown(found));
    } catch (error) {
      if (this.#isNew && error.message !== OUTDATED) show(this.#body, h('p', {}, error.message));
    }
  }

  // Write at once what is in the fields of the form.
  async flush() { await this.#form.flush(); }

  // Show nothing, since the text is that of another file.
  clear() {
    clearTimeout(this.#pause);
    [this.#bundle, this.#id, this.#shownId, this.#wanted] = [null, null, null, null];
    this.#form.clear();
    show(this.#body);
    if (!this.#isNew) this.#showNone();
  }

  use(bundle) {
    this.#bundle = bundle;
    if (this.#isNew) {
      this.#new.again();
      return;
    }
    const ids = bundle.requirements.map((item) => item.id);
    this.#id = [this.#wanted, this.#id, ids[0]].find((id) => ids.includes(id)) ?? null;
    show(this.#select, ...ids.map((id) => h('option', { value: id }, id)));
    this.#select.value = this.#id ?? '';
    if (!this.#place.contains(this.#select)) {
      show(this.#place, h('label', {}, words.requirement, ' ', this.#select),
        ' ', this.#add, this.#form.element, this.#body);
    }
    if (this.#id === this.#wanted) {
      this.#wanted = null;
      this.#go(bundle.requirements.find((item) => item.id === this.#id).from);
    }
    clearTimeout(this.#pause);
    if (this.#id === this.#shownId) this.#pause = setTimeout(() => this.#explain(), PAUSE_MS);
    else this.#explain();
  }

  // Show the requirement in which an offset of the text is.
  follow(offset) {
    if (!this.#bundle || this.#isNew) return;
    const found = this.#bundle.requirements.filter((item) => item.from <= offset).at(-1);
    if (!found || found.id === this.#id) return;
    this.#id = found.id;
    this.#select.value = found.id;
    this.#explain();
  }

  async #explain() {
    clearTimeout(this.#pause);
    const id = this.#id;
    if (!id) {
      show(this.#body);
      return;
    }
    if (id !== this.#shownId) show(this.#body, h('p', { class: 'faint' }, words.reading));
    this.#shownId = id;
    this.#isSentence = await this.#form.use(id);
    try {
      const found = await this.#ask('explain', { id });
      if (id === this.#id && !this.#isNew) show(this.#body, ...this.#shown(found));
    } catch (error) {
      if (id === this.#id && !this.#isNew && error.message !== OUTDATED) {
        show(this.#body, h('p', {}, error.message));
      }
    }
  }

  #shown(found) {
    const rows = [
      ...Object.entries(found.meaning), [words.ifFalse, found.if_false],
      ...found.notes.map((note) => [words.notes, note])];
    return [
      found.title ? h('h3', {}, found.title) : null,
      this.#isSentence ? null : h('p', { class: 'sentence' }, found.text),
      h('dl', {}, ...rows.flatMap(([name, text]) => [h('dt', {}, name), h('dd', {}, text)])),
      h('details', {}, h('summary', {}, words.formula), h('code', {}, found.formula)),
      ...found.examples.map(drawing)].filter(Boolean);
  }
}

// Return the drawing of an example: a row for each proposition, and the verdict.
function drawing(example) {
  const rows = [...example.rows, { label: 'verdict', truth: example.verdict, isVerdict: true }];
  const width = Math.max(example.steps.length * CELL, 60);
  const cells = (row) => row.truth.map((truth, column) => example.steps[column] === null
    ? svg('text', { x: (column + 0.5) * CELL, y: 14, class: 'gap' }, '~')
    : svg('rect', {
      class: `${row.isVerdict ? 'verdict' : 'truth'} ${truth ? 'is-true' : 'is-false'}`,
      x: column * CELL, width: CELL - 1, y: row.isVerdict || truth ? 2 : 12,
      height: row.isVerdict || truth ? 14 : 4 }));
  const text = (row) => `${row.label}: ${row.truth.map((truth, column) =>
    example.steps[column] === null ? '~' : Number(truth)).join('')}`;
  const marks = example.steps.flatMap((step, column) => step === null || column % 5
    ? [] : [svg('text', { x: column * CELL, y: 12, class: 'mark' },
      example.seconds_per_step ? `${Number((step * example.seconds_per_step).toPrecision(4))} s`
        : String(step))]);
  return h('figure', {},
    h('figcaption', {}, example.title),
    h('div', { class: 'example' },
      ...rows.flatMap((row) => [
        h('span', { class: 'name', title: row.label }, row.label),
        svg('svg', { width, height: ROW, role: 'img', 'aria-label': text(row) }, ...cells(row))]),
      h('span'), svg('svg', { width: width + 20, height: ROW, 'aria-hidden': 'true' }, ...marks)),
    ...example.values.map((line) => h('p', { class: 'faint' }, line)));
}
