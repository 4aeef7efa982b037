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
  #writing = null;

  // `changed` is called when somebody has written something.
  constructor(prefix, changed) {
    this.#prefix = prefix;
    this.#changed = changed;
  }

  get values() {
    return Object.fromEntries(
      Object.entries(this.#inputs).map(([name, input]) => [name, input.value]));
  }

  // Write at once what somebody has just written.
  async flush() {
    if (this.#pause) {
      this.drop();
      this.#writing = this.#changed();
    }
    await this.#writing;
  }

  drop() {
    clearTimeout(this.#pause);
    this.#pause = 0;
  }

  // Show the fields, in place of those before.
  show(fields) {
    this.drop();
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
        this.#pause = setTimeout(() => this.flush(), PAUSE_MS);
      },
      onchange: () => this.flush() }); // it is left
    this.#inputs[name] = input;
    this.#fill(input, text);
    return h('label', { class: `field of-${name}` }, h('small', {}, words.fieldNames[name]), ' ',
      input, h('datalist', { id: `${id}-words` },
        ...begin.map((word) => h('option', { value: word }))));
  }

  #fill(input, text) {
    if (input.value !== text) input.value = text;
    input.size = Math.max(8, input.placeholder.length + 2, Math.min(60, text.length + 1));
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

  // `edit(ask)` writes into the text what `ask` answers.
  constructor(ask, edit) {
    this.#ask = ask;
    this.#edit = edit;
  }

  get component() { return this.#fields.values.component ?? ''; }

  // Show the fields of a requirement; return whether it is a sentence.
  async use(id) {
    await this.flush();
    const fields = await this.#ask('form', { id }).catch(() => []);
    const isHere = id === this.#id && this.element.contains(document.activeElement);
    if (isHere) this.#fields.update(fields);
    else {
      this.#id = id;
      this.#fields.show(fields);
    }
    return fields.length > 0 || isHere;
  }

  async flush() { await this.#fields.flush(); }

  // Show no requirement, since the text is that of another file.
  clear() {
    this.#id = null;
    this.#fields.show([]);
  }

  async #write() {
    const [id, fields] = [this.#id, this.#fields.values];
    await this.#edit(async () => {
      const found = await this.#ask('reword', { id, fields }).catch(() => null);
      return id === this.#id ? found : null;
    });
  }
}

// The fields of a new requirement, which is written into the text when somebody wants it.
export class NewForm {
  #ask;
  #edit;
  #explain;
  #isAdding = false;
  #fields = new Fields('new', () => this.#try());
  #id = h('input', { id: 'new-id', size: 12, autocomplete: 'off', spellcheck: 'false',
    oninput: () => this.#try() });
  #problems = h('ul', { class: 'help', 'aria-live': 'polite', id: 'new-problems' });
  #add = h('button', { id: 'new-add', disabled: true }, words.addRequirement);
  #found = null;
  element = form(words.newRequirement, h('p', { class: 'faint' }, words.newHelp),
    h('label', {}, words.newId, ' ', this.#id),
    this.#fields.element, this.#problems, h('div', { class: 'tools' }, this.#add,
      h('button', { type: 'button', onclick: () => this.#close(null) }, words.no)));

  // `edit` is as of the form; `explain(text, id)` shows what it means in a text, null: nothing;
  // `close(id)` ends it, null: there is none.
  constructor(ask, edit, explain, close) {
    this.#ask = ask;
    this.#edit = edit;
    this.#explain = explain;
    this.#close = close;
    this.element.addEventListener('submit', () => this.#write());
  }

  // Write what is in the fields now into the text as it is now.
  async #write() {
    this.#isAdding = true;
    this.#fields.drop();
    const found = await this.#edit(() => this.#try());
    this.#isAdding = false;
    if (found) this.#close(this.#name);
  }

  // The id as it is written.
  get #name() { return this.#id.value.trim().replace(/\s+/g, ' '); }

  // The text is another one.
  again() {
    if (this.#found && !this.#isAdding) this.#try();
  }

  #close;

  async begin(component) {
    this.#id.value = '';
    this.#fields.show([]);
    const fields = await this.#ask('form', { id: null }).catch(() => []);
    this.#fields.show(fields);
    this.#fields.update([{ name: 'component', text: component }]);
    this.#take(null, []);
    if (this.#name) this.#try(); // typed before the fields came
    this.#id.focus();
  }

  async #try() {
    try {
      const found = await this.#ask('draft', { id: this.#id.value, fields: this.#fields.values });
      if (!this.element.isConnected) return null;
      this.#take(found, found.problems);
      return found;
    } catch (error) {
      if (error.message !== OUTDATED && this.element.isConnected) this.#take(null, [error.message]);
      return null;
    }
  }

  // It may be written with mistakes, as any text.
  #take(found, problems) {
    this.#found = found;
    this.#add.disabled = !found;
    show(this.#problems, ...problems.map((text) => h('li', {}, text)));
    const isGood = found && !problems.length;
    this.#explain(isGood ? found.whole : null, this.#name);
  }
}
