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
import { words } from './words.js';

const PAUSE_MS = 300; // after a key, before it is written

export class Form {
  element = h('form', { class: 'sentence', 'aria-label': words.form,
    onsubmit: (event) => event.preventDefault() });
  #ask;
  #edit;
  #id = null;
  #inputs = {};
  #pause = 0;

  // `edit({from, to, text})` writes into the text.
  constructor(ask, edit) {
    this.#ask = ask;
    this.#edit = edit;
  }

  // Show the fields of a requirement; return whether it is a sentence.
  async use(id) {
    const fields = await this.#ask('form', { id }).catch(() => []);
    const isHere = id === this.#id && this.element.contains(document.activeElement);
    if (isHere && fields.length) {
      for (const { name, text } of fields) {
        const input = this.#inputs[name];
        if (input && input !== document.activeElement) this.#fill(input, text);
      }
    } else if (!isHere) {
      clearTimeout(this.#pause);
      this.#id = id;
      this.#inputs = {};
      show(this.element, ...fields.map((field) => this.#field(field)));
    }
    return fields.length > 0 || isHere;
  }

  #field({ name, text, words: begin }) {
    const input = h('input', {
      id: `field-${name}`, autocomplete: 'off', spellcheck: 'false', list: `words-${name}`,
      placeholder: words.fieldHints[name],
      oninput: () => {
        this.#fill(input, input.value);
        clearTimeout(this.#pause);
        this.#pause = setTimeout(() => this.#write(), PAUSE_MS);
      } });
    this.#inputs[name] = input;
    this.#fill(input, text);
    return h('label', { class: `field of-${name}` }, h('small', {}, words.fieldNames[name]), ' ',
      input, h('datalist', { id: `words-${name}` },
        ...begin.map((word) => h('option', { value: word }))));
  }

  #fill(input, text) {
    if (input.value !== text) input.value = text;
    input.size = Math.max(8, input.placeholder.length, Math.min(60, text.length + 1));
  }

  async #write() {
    const fields = Object.fromEntries(
      Object.entries(this.#inputs).map(([name, input]) => [name, input.value]));
    const found = await this.#ask('reword', { id: this.#id, fields }).catch(() => null);
    if (found) this.#edit(found);
  }
}
