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

// The page: a bundle, what is wrong with it, what it means, and a trace to try it on.

import { h, show } from './dom.js';
import { Drafts } from './drafts.js';
import { Editor } from './editor.js';
import { LiveView } from './live.js';
import { Meaning } from './meaning.js';
import { Picture } from './picture.js';
import { Recordings } from './recordings.js';
import { OUTDATED, Talk } from './talk.js';
import { Tryout } from './tryout.js';
import { words } from './words.js';

const MOST_PROBLEMS = 100; // that are listed
const PAUSE_MS = 60; // after a key, before the text is checked
const NEW = `format: 1
evaluation: {policy: timed}
inputs:
  speed: {topic: odom, type: nav_msgs/msg/Odometry, field: twist.twist.linear.x}
requirements:
  - id: SPEED
    fretish: the robot shall always satisfy speed <= 1.0
`;

const at = (id) => document.getElementById(id);
const talk = new Talk();
const drafts = new Drafts();
const file = { name: null, stamp: null, saved: '', isShown: false };
let pause = 0;
let isLost = false; // the connection

for (const name of ['write', 'read', 'try', 'recordings', 'picture', 'live']) {
  at(`${name}-title`).textContent = words[name];
}
at('nav').setAttribute('aria-label', words.parts);
show(at('nav'), ...Object.entries(words.nav).map(([id, name]) => h('a', { href: `#${id}` }, name)));
at('problems').setAttribute('aria-label', words.problems(1, 0));

const ask = (what, question = {}) => talk.ask(what, {
  name: file.name ?? 'new.yaml', text: editor.text, ...question });
const editor = new Editor(at('editor'), {
  ask, changed, moved: (offset) => meaning.follow(offset), save });
const meaning = new Meaning(at('meaning'), ask, (offset) => editor.go(offset),
  (asked) => editor.change(asked));
const picture = new Picture(at('drawn'), ask, (offset) => editor.go(offset));
const tryout = new Tryout(at('trace'), ask);
const recordings = new Recordings(at('recorded'), ask, (trace, note) => {
  tryout.take(trace, note);
  at('try').scrollIntoView();
});
new LiveView(at('watch'), ask, talk, (...names) => picture.mark(...names));
show(at('trace'), h('p', { class: 'faint' }, words.noTrace));

const files = h('select', { id: 'file', onchange: () => open(files.value || null) });
const button = (label, run, id) => h('button', { type: 'button', onclick: run, id }, label);
show(at('files'), words.file, ' ', files);
show(at('actions'), button(words.save, save, 'save'), button(words.saveAs, saveAs, 'save-as'),
  button(words.format, format, 'format'));

// What is open, and what of it is saved.

const draft = (name = file.name) => `${file.folder}/${name ?? ''}`;

function changed() {
  clearTimeout(pause);
  pause = setTimeout(check, PAUSE_MS);
  state(words.checking);
  if (editor.text === file.saved) drafts.drop(draft());
  else if (!drafts.keep(draft(), editor.text, file.stamp)) notice(words.noRoom, []);
}

function state(text) {
  at('state').textContent = [
    text, editor.text === file.saved && file.stamp ? words.saved : words.unsaved].join(' · ');
}

async function begin() {
  const found = await talk.ask('open');
  file.folder = found.folder;
  list(found.names);
  recordings.list(found.recordings);
  await open(found.bundle ?? found.names[0] ?? null);
}

function list(names) {
  show(files, ...names.map((name) => h('option', { value: name }, name)),
    h('option', { value: '' }, words.noFile));
}

async function open(name) {
  try {
    await meaning.flush();
    const found = name ? await talk.ask('read', { name }) : { text: NEW, stamp: null };
    const text = found.text.replace(/\r\n?/g, '\n'); // the editor has no other line ends
    const kept = await drafts.take(draft(name));
    if (name !== file.name) forget();
    Object.assign(file, { name, stamp: found.stamp, saved: name ? text : '' });
    files.value = name ?? '';
    editor.load(kept.draft?.text ?? text);
    restored(kept, text);
    await check();
  } catch (error) {
    files.value = file.name ?? '';
    notice(error.message, []);
  }
}

// Say what is shown in place of the text of the file. A draft may be one of an older file.
function restored({ draft: kept, more, isElsewhere }, text) {
  const isShown = kept !== null && kept.text !== text;
  const notes = [isShown ? words.restored : '', more ? words.moreDrafts(more) : '',
    isElsewhere ? words.elsewhere : ''].filter(Boolean).join(' ');
  if (isShown && file.name && kept.stamp !== file.stamp) {
    file.stamp = kept.stamp;
    changedBy(file.name, notes);
  } else notice(notes, isShown && file.name ? [again(file.name)] : []);
}

async function save() {
  await meaning.flush();
  if (!file.name) return saveAs();
  if (editor.text === file.saved || !await asked(words.askSave(file.name))) return undefined;
  return write(file.name, file.stamp);
}

async function saveAs() {
  const name = await asked(words.askName, file.name ?? 'requirements.yaml');
  if (name) await write(name, name === file.name ? file.stamp : null);
}

async function write(name, stamp) {
  const { text } = editor;
  try {
    const like = file.stamp && file.name; // its line ends are kept
    const found = await talk.ask('write', { name, text, stamp, like });
    drafts.drop(draft());
    Object.assign(file, { name, stamp: found.stamp, saved: text });
    list((await talk.ask('open')).names);
    files.value = name;
    notice();
    await check();
  } catch (error) {
    if (!isLost && name === file.name && await toldChange()) return;
    notice(isLost ? words.lost : error.message, []);
  }
}

// Say so if the file on disk is not the one that the text was made of; return whether it is not.
async function toldChange() {
  const { name, stamp } = file;
  const found = await talk.ask('read', { name }).catch(() => null);
  if (found?.stamp === stamp) return false;
  if (found) changedBy(name);
  else gone(name);
  return true;
}

async function format() {
  const { text } = editor;
  const found = await ask('format').catch(() => null);
  if (found !== null && text === editor.text) editor.write(found);
}

// What is written here is dropped.
const again = (name) => [words.reload, async () => {
  await meaning.flush();
  drafts.drop(draft());
  await open(name);
}];

const over = (name, label) => [label, async () => {
  const found = await talk.ask('read', { name }).catch(() => null);
  await write(name, found?.stamp ?? null);
}];

const keep = [words.keep, () => notice()];

const changedBy = (name, notes = '') => notice([words.changed(name), notes].join(' '), [
  again(name), over(name, words.overwrite), keep]);

const gone = (name) => notice(words.gone(name), [over(name, words.anew), keep]);

talk.addEventListener('changed', (event) => changedBy(event.detail));
talk.addEventListener('gone', (event) => gone(event.detail));
talk.addEventListener('recordings', (event) => recordings.list(event.detail));
talk.addEventListener('close', () => {
  isLost = true;
  notice(words.lost, []);
});
talk.addEventListener('open', async () => {
  if (!isLost) return;
  isLost = false;
  notice(); // the connection alone was lost, such as that of a tunnel
  if (file.name) await toldChange();
  await check();
});
addEventListener('beforeunload', (event) => {
  if (editor.text !== file.saved && editor.text !== NEW) event.preventDefault();
});

function notice(text = '', choices = []) {
  at('notice').hidden = !text;
  show(at('notice'), text, ...choices.map(([label, run]) => button(label, run)));
}

// Ask for a yes, or for a name.
function asked(question, name = null) {
  const dialog = at('ask');
  const input = name === null ? null : h('input', { value: name, id: 'ask-name' });
  return new Promise((resolve) => {
    show(dialog, h('form', { method: 'dialog' },
      h('label', {}, question, ' ', input),
      h('menu', {},
        // Enter is the first button that submits.
        h('button', { type: 'button', onclick: () => dialog.close('') }, words.no),
        h('button', { value: 'yes', id: 'ask-yes' }, words.yes))));
    dialog.onclose = () => resolve(dialog.returnValue && (input ? input.value.trim() : true));
    dialog.returnValue = '';
    dialog.showModal();
    (input ?? at('ask-yes')).focus();
  });
}

// What is wrong with the text.

async function check() {
  clearTimeout(pause);
  const { text } = editor;
  try {
    const found = await ask('check');
    if (text !== editor.text) return;
    const count = (severity) => found.diagnostics.filter(
      (item) => item.severity === severity).length;
    editor.mark(found.diagnostics);
    state(words.problems(count('error'), count('warning')) || words.good);
    problems(found.diagnostics, text);
    document.body.dataset.checked = String(Number(document.body.dataset.checked ?? 0) + 1);
    picture.use();
    old(!found.bundle);
    if (found.bundle) {
      file.isShown = true;
      meaning.use(found.bundle);
      tryout.use(found.bundle);
    }
  } catch (error) {
    if (error.message === OUTDATED) return;
    state(error.message);
    old(true);
  }
}

// Say whether what is shown of the text is of an older one.
function old(isOld) {
  const isShown = isOld && file.isShown;
  document.body.classList.toggle('is-old', isShown);
  for (const name of ['read', 'try']) {
    show(at(`${name}-title`), words[name], isShown ? h('small', {}, ` ${words.old}`) : null);
  }
}

// Show nothing of the text, since that of another file comes.
function forget() {
  file.isShown = false;
  old(false);
  meaning.clear();
  tryout.clear();
}

async function problems(diagnostics, text) {
  const more = diagnostics.length - MOST_PROBLEMS;
  const rows = diagnostics.slice(0, MOST_PROBLEMS).map((item) => h('li', { class: item.severity },
    h('button', { type: 'button', class: 'place', onclick: () => editor.go(item.from) },
      item.file ?? (item.line ? `${words.write} ${item.line}` : words.write)),
    h('span', {}, [item.title, item.label].filter(Boolean).join(': ')),
    item.help ? h('p', { class: 'help' }, item.help) : null));
  show(at('problems'), h('ul', {}, ...rows, more > 0 ? h('li', {}, words.moreProblems(more)) : null));
  if (!diagnostics.length) return;
  const found = await ask('fixes').catch(() => []);
  if (text !== editor.text) return;
  found.forEach((ways, number) => rows[number].append(...ways.map((way) => h(
    'button', { type: 'button', class: 'fix', onclick: () => { if (text === editor.text) editor.edit(way); } },
    `${words.fix}: ${way.title}`))));
}

begin();
