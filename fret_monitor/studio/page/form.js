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

// The fields of a FRETish sentence, which are written into the text of the bundle.

import { h, show } from './dom.js';
import { OUTDATED } from './talk.js';
import { words } from './words.js';

const PAUSE_MS = 300; // after a key, before it is written

// The fields of a sentence as inputs, one colour each.
export class Fields {
  element = h('div', { class: 'sentence' });
  #prefix;
  #changed;
  #inputs = {};
  #pause = 0;

  // `changed` is called when somebody has written something.
  constructor(prefix, changed) {
    this.#prefix = prefix;
    this.#changed = changed;
  }

  get values() {
    return Object.fromEntries(
      Object.entries(this.#inputs).map(([name, input]) => [name, input.value]));
  }

  // Show the fields, in place of those before.
  show(fields) {
    clearTimeout(this.#pause);
    this.#inputs = {};
    show(this.element, ...fields.map((field) => this.#field(field)));
  }

  // Take new texts, but for the field in which somebody writes.
  update(fields) {
    for (const { name, text } of fields) {
      const input = this.#inputs[name];
      if (input && input !== document.activeElement) this.#fill(input, text);
    }
  }

  #field({ name, text, words: begin }) {
    const id = `${this.#prefix}-${name}`;
    const input = h('input', {
      id, autocomplete: 'off', spellcheck: 'false', list: `${id}-words`,
      placeholder: words.fieldHints[name],
      oninput: () => {
        this.#fill(input, input.value);
        clearTimeout(this.#pause);
        this.#pause = setTimeout(this.#changed, PAUSE_MS);
      } });
    this.#inputs[name] = input;
    this.#fill(input, text);
    return h('label', { class: `field of-${name}` }, h('small', {}, words.fieldNames[name]), ' ',
      input, h('datalist', { id: `${id}-words` },
        ...begin.map((word) => h('option', { value: word }))));
  }

  #fill(input, text) {
    if (input.value !== text) input.value = text;
    input.size = Math.max(8, input.placeholder.length, Math.min(60, text.length + 1));
  }
}

const form = (label, ...children) => h('form', {
  'aria-label': label, onsubmit: (event) => event.preventDefault() }, ...children);

// The fields of a requirement, which are written into the text of the bundle.
export class Form {
  #ask;
  #edit;
  #id = null;
  #fields = new Fields('field', () => this.#write());
  element = form(words.form, this.#fields.element);

  // `edit({from, to, text})` writes into the text.
  constructor(ask, edit) {
    this.#ask = ask;
    this.#edit = edit;
  }

  get component() { return this.#fields.values.component ?? ''; }

  // Show the fields of a requirement; return whether it is a sentence.
  async use(id) {
    const fields = await this.#ask('form', { id }).catch(() => []);
    const isHere = id === this.#id && this.element.contains(document.activeElement);
    if (isHere) this.#fields.update(fields);
    else {
      this.#id = id;
      this.#fields.show(fields);
    }
    return fields.length > 0 || isHere;
  }

  async #write() {
    const found = await this.#ask('reword', { id: this.#id, fields: this.#fields.values })
      .catch(() => null);
    if (found) this.#edit(found);
  }
}

// The fields of a new requirement, which is written into the text when somebody wants it.
export class NewForm {
  #ask;
  #explain;
  #fields = new Fields('new', () => this.#try());
  #id = h('input', { id: 'new-id', size: 12, autocomplete: 'off', spellcheck: 'false',
    oninput: () => this.#try() });
  #problems = h('ul', { class: 'help', 'aria-live': 'polite', id: 'new-problems' });
  #add = h('button', { id: 'new-add', disabled: true }, words.addRequirement);
  #found = null;
  element = form(words.newRequirement, h('label', {}, words.newId, ' ', this.#id),
    this.#fields.element, this.#problems, h('div', { class: 'tools' }, this.#add,
      h('button', { type: 'button', onclick: () => this.#close(null) }, words.no)));

  // `explain(text, id)` shows what it means in a text, null: nothing; `close(edit, id)` ends it.
  constructor(ask, explain, close) {
    this.#ask = ask;
    this.#explain = explain;
    this.#close = close;
    this.element.addEventListener('submit', () => {
      if (this.#found) this.#close(this.#found, this.#id.value.trim());
    });
  }

  #close;

  async begin(component) {
    const fields = await this.#ask('form', { id: null }).catch(() => []);
    this.#fields.show(fields);
    this.#fields.update([{ name: 'component', text: component }]);
    this.#id.value = '';
    this.#take(null, []);
    this.#id.focus();
  }

  async #try() {
    try {
      const found = await this.#ask('draft', { id: this.#id.value, fields: this.#fields.values });
      this.#take(found, found.problems);
    } catch (error) {
      if (error.message !== OUTDATED) this.#take(null, [error.message]);
    }
  }

  // It may be written with mistakes, as any text.
  #take(found, problems) {
    this.#found = found;
    this.#add.disabled = !found;
    show(this.#problems, ...problems.map((text) => h('li', {}, text)));
    const isGood = found && !problems.length;
    this.#explain(isGood ? found.whole : null, this.#id.value.trim());
  }
}
