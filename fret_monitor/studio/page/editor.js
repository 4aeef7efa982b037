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

// The text of the bundle, with the help of the server.

import {
  autocompletion, bracketMatching, completionKeymap, defaultHighlightStyle, defaultKeymap,
  drawSelection, EditorState, EditorView, foldGutter, foldKeymap, highlightActiveLine, history,
  historyKeymap, HighlightStyle, hoverTooltip, indentUnit, keymap, lineNumbers, lintGutter,
  lintKeymap, search, searchKeymap, setDiagnostics, syntaxHighlighting, tags, yaml,
} from './vendor/codemirror.js';
import { markdown } from './dom.js';
import { words } from './words.js';

const KINDS = {
  key: 'property', value: 'enum', input: 'variable', constant: 'constant', definition: 'variable',
  word: 'keyword', function: 'function', type: 'type', field: 'property', topic: 'text',
  name: 'text',
};
const COLOURS = HighlightStyle.define([
  { tag: [tags.propertyName, tags.definition(tags.propertyName)], class: 'of-key' },
  { tag: [tags.string, tags.content], class: 'of-text' },
  { tag: [tags.comment, tags.lineComment], class: 'of-comment' },
  { tag: [tags.number, tags.bool, tags.atom], class: 'of-value' },
]);

export class Editor {
  #view;
  #ask;
  #extensions;

  // `ask(what, question)` asks the server; `changed` and `moved` are called by the editor.
  constructor(place, { ask, changed, moved, save }) {
    this.#ask = ask;
    this.#extensions = [
      EditorView.cspNonce.of(document.querySelector('meta[name=csp-nonce]').content),
      EditorState.phrases.of({}),
      lineNumbers(), foldGutter(), history(), drawSelection(), highlightActiveLine(),
      bracketMatching(), indentUnit.of('  '), yaml(), syntaxHighlighting(COLOURS),
      syntaxHighlighting(defaultHighlightStyle, { fallback: true }), lintGutter(), search(),
      EditorView.lineWrapping,
      EditorView.contentAttributes.of({ 'aria-label': words.write }),
      autocompletion({ override: [(context) => this.#complete(context)] }),
      hoverTooltip((_, offset) => this.#hover(offset)),
      keymap.of([
        { key: 'Mod-s', preventDefault: true, run: () => { save(); return true; } },
        ...defaultKeymap, ...searchKeymap, ...historyKeymap, ...foldKeymap,
        ...completionKeymap, ...lintKeymap]),
      EditorView.updateListener.of((update) => {
        if (update.docChanged) changed();
        if (update.selectionSet || update.docChanged) moved(this.offset);
      }),
    ];
    this.#view = new EditorView({ parent: place, state: this.#begun('') });
  }

  #begun(doc, anchor = 0) {
    return EditorState.create({ doc, selection: { anchor }, extensions: this.#extensions });
  }

  get text() {
    return this.#view.state.doc.toString();
  }

  get offset() {
    return this.#view.state.selection.main.head;
  }

  // Show the text of a file: nothing before it can be undone, and the page is not told.
  load(text) {
    this.#view.setState(this.#begun(text, Math.min(this.offset, text.length)));
  }

  // Replace the text.
  write(text) {
    if (text === this.text) return;
    this.#view.dispatch({
      changes: { from: 0, to: this.#view.state.doc.length, insert: text },
      selection: { anchor: Math.min(this.offset, text.length) },
    });
  }

  // Make the edit that `ask` answers, null: none; it asks again if the text changes meanwhile.
  async change(ask) {
    for (;;) {
      const { text } = this;
      const found = await ask();
      if (found && text !== this.text) continue;
      if (found) this.edit(found, { focus: false });
      return found;
    }
  }

  edit({ from, to, text }, { focus = true } = {}) {
    this.#view.dispatch({ changes: { from, to, insert: text } });
    if (focus) this.#view.focus();
  }

  go(offset) {
    this.#view.dispatch({ selection: { anchor: offset }, scrollIntoView: true });
    this.#view.focus();
  }

  mark(diagnostics) {
    const last = this.#view.state.doc.length;
    this.#view.dispatch(setDiagnostics(this.#view.state, diagnostics.map((item) => ({
      from: Math.min(item.from, last), to: Math.min(item.to, last), severity: item.severity,
      message: [item.title, item.label, item.help].filter(Boolean).join('\n'),
    }))));
  }

  async #complete(context) {
    const before = context.matchBefore(/[\w./{}-]*/);
    if (!context.explicit && !before?.text && !/[( ]$/.test(
      context.state.doc.lineAt(context.pos).text.slice(0, context.pos))) return null;
    const found = await this.#ask('complete', { offset: context.pos }).catch(() => []);
    if (!found.length) return null;
    const [{ from }] = found;
    const fitting = found.filter((item) => item.from === from);
    const typed = context.state.sliceDoc(from, context.pos);
    // Behind what is whole, such as a number, Enter is a new line, not the first proposal.
    if (!context.explicit && (fitting.some((item) => item.text === typed)
      || (!typed && before?.text))) return null;
    return {
      from,
      options: fitting.map((item) => ({
        label: item.label, detail: item.detail, apply: item.text, type: KINDS[item.kind],
      })),
    };
  }

  async #hover(offset) {
    const found = await this.#ask('hover', { offset }).catch(() => null);
    return found && {
      pos: found.from, end: found.to,
      create: () => ({ dom: markdown(found.markdown) }),
    };
  }
}
