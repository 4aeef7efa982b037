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


// A running monitor, as it publishes: verdicts, inputs, occurrences, health of topics. What is
// kept is bounded: five minutes of each row, a hundred occurrences.

import { Axis, h, named, show, svg } from './dom.js';
import { numbers, truths, WIDTH } from './lanes.js';
import { words } from './words.js';

const KEPT_MS = 300_000;
const MOST_KEPT = 6_000; // changes of a row
const MOST_OCCURRENCES = 100;
const COLUMNS = 300; // of a curve: more changes than that are thinned
const SPANS = [10, 60, 300];
const HEIGHT = { verdict: 20, input: 48 };
const OF_ALL = ['stamp', 'suppressed']; // details that say nothing beside the time
const TOPIC = /^topic /; // of a status
const LEVELS = ['is-good', 'is-warning', 'is-bad'];

// The changes of a row, oldest first; what is too old is dropped, but for what still holds.
export class History {
  changes = [];

  add(time, value) {
    if (this.changes.length && this.changes.at(-1)[1] === value) return;
    this.changes.push([time, value]);
    let drop = Math.max(0, this.changes.length - MOST_KEPT);
    while (drop + 1 < this.changes.length && this.changes[drop + 1][0] < time - KEPT_MS) drop += 1;
    if (drop) this.changes.splice(0, drop);
  }

  // What holds at a time; undefined: nothing is known.
  at(time) { return this.changes.findLast((change) => change[0] <= time)?.[1]; }

  // At most a few changes for each column of a drawing, with the extremes of each.
  thinned(view) {
    const seen = this.changes.filter(([time], number) => time < view.first + view.count
      && (this.changes[number + 1]?.[0] ?? Infinity) > view.first);
    if (seen.length <= 4 * COLUMNS) return seen;
    const columns = new Map();
    for (const change of seen) {
      const column = Math.floor((change[0] - view.first) / view.count * COLUMNS);
      const kept = columns.get(column) ?? [change, change, change, change];
      columns.set(column, [kept[0], change[1] < kept[1][1] ? change : kept[1],
        change[1] > kept[2][1] ? change : kept[2], change]);
    }
    return [...columns.values()].flatMap((kept) => [...new Set(kept)].sort((a, b) => a[0] - b[0]));
  }
}

class Row {
  history = new History();
  isSeen = true;

  constructor(name, kind, input = null) {
    Object.assign(this, { name, kind, input });
    const height = input && !input.isBool ? HEIGHT.input : HEIGHT.verdict;
    this.height = height;
    this.picture = svg('svg', {
      class: 'lane live', viewBox: `0 0 ${WIDTH} ${height}`, preserveAspectRatio: 'none', height,
      role: 'img', 'aria-label': name });
    this.shown = h('output', { class: 'now', 'aria-live': 'off' });
    this.axis = input && !input.isBool && !Object.keys(input.names).length ? new Axis() : null;
    this.parts = [named(name, this.axis), this.picture, this.shown];
  }

  text(last) {
    if (last === undefined || last === null) return words.notKnown;
    if (this.kind === 'verdict') return last ? words.satisfied : words.violated;
    if (this.input.names[last] !== undefined) return this.input.names[last];
    return typeof last === 'number' ? String(Number(last.toPrecision(6))) : String(last);
  }

  draw(view) {
    const { history, kind } = this;
    const end = view.first + view.count;
    const text = this.text(history.at(end));
    const value = history.at(view.pointed ?? end);
    this.shown.textContent = this.text(value);
    this.shown.className = `now ${kind}${
      kind !== 'verdict' || typeof value !== 'boolean' ? '' : value ? ' is-true' : ' is-false'}`;
    this.picture.setAttribute('aria-label', `${this.name}: ${text}`);
    if (!this.isSeen) return;
    const changes = history.thinned(view);
    this.picture.replaceChildren(...(kind === 'verdict' || this.input.isBool
      ? truths(changes, view, end, kind === 'verdict' ? 'verdict' : 'truth')
      : numbers(changes, view, end, this.#scale(changes))),
    ...(view.pointed === null ? [] : [svg('line', { class: 'pointed', y1: 0, y2: this.height,
      x1: view.x(view.pointed), x2: view.x(view.pointed) })]));
  }

  #scale(changes) {
    const values = changes.map(([, value]) => value).filter(Number.isFinite);
    const [least, greatest] = [Math.min(...values), Math.max(...values)];
    const room = (greatest - least) / 8 || Math.max(1, Math.abs(least) / 2);
    this.axis?.show(least - room, greatest + room);
    return (value) => Number.isFinite(value)
      ? this.height * (greatest + room - value) / (greatest - least + 2 * room) : null;
  }
}

export class LiveView {
  #place;
  #ask;
  #rows = new Map();
  #health = {};
  #parts = {};
  #isOn = false;
  #frozen = null; // the time at which it was paused
  #skew = null; // of the robot's clock, ms
  #span = 60;
  #drawing = 0;
  #pointed = null; // where the pointer is in a row, as a part of its width
  #seen;
  #others = []; // namespaces with a monitor
  #command = null; // that starts a monitor of the bundle
  #violated = new Set(); // requirements and instances, now
  #broken;

  // `ask` as of the editor, with the bundle in the question; `talk` has what is pushed;
  // `broken(requirements, topics)` is given the names of what is violated or in trouble now.
  constructor(place, ask, talk, broken) {
    this.#broken = broken;
    this.#place = place;
    this.#ask = ask;
    talk.addEventListener('live', (event) => this.#take(event.detail));
    talk.addEventListener('close', () => this.#leave(words.notWatching));
    this.#seen = new IntersectionObserver((entries) => entries.forEach((entry) => {
      const row = [...this.#rows.values()].find((each) => each.picture === entry.target);
      if (row) row.isSeen = entry.isIntersecting;
    }));
    this.#build();
  }

  #build() {
    const button = (id, label, run) => h('button', { type: 'button', id, onclick: run }, label);
    const parts = this.#parts = {
      namespace: h('input', { id: 'live-namespace', size: 12, value: '/', autocomplete: 'off' }),
      connect: button('live-connect', words.connect, () => this.#toggle()),
      pause: button('live-pause', words.pause, () => this.#pause()),
      monitor: h('select', { id: 'live-monitor', 'aria-label': words.monitor }),
      reset: button('live-reset', words.reset, () => this.#reset()),
      span: h('select', { id: 'live-span', onchange: () => {
        this.#span = Number(parts.span.value);
        this.#draw();
      } }, ...SPANS.map((each) => h('option', { value: each, selected: each === 60 },
        words.span(each)))),
      status: h('p', { id: 'live-status', role: 'status' }, words.notWatching),
      rows: h('div', { class: 'rows', id: 'live-rows',
        onpointermove: (event) => this.#point(event),
        onpointerdown: (event) => this.#point(event),
        onpointerleave: () => { this.#pointed = null; } }),
      begin: h('span'), pointed: h('span'),
      occurrences: h('ol', { id: 'live-occurrences', role: 'log', tabindex: 0,
        'aria-label': words.violations }),
      health: h('div', { id: 'live-health', role: 'region', tabindex: 0,
        'aria-label': words.health }),
      note: h('p', { class: 'faint', id: 'live-note' }) };
    show(this.#place, h('div', { class: 'tools' },
      h('label', {}, words.namespace, ' ', parts.namespace), parts.connect, parts.pause,
      h('label', {}, words.shownSpan, ' ', parts.span), parts.monitor, parts.reset),
    parts.status, parts.rows, parts.note,
    h('div', { class: 'columns' },
      h('div', {}, h('h3', {}, words.violations), parts.occurrences),
      h('div', {}, h('h3', {}, words.health), parts.health)));
    this.#enable();
  }

  #enable() {
    const { pause, reset, monitor } = this.#parts;
    pause.disabled = !this.#isOn;
    reset.disabled = !this.#isOn || !monitor.value;
    monitor.hidden = monitor.options.length < 2;
    this.#parts.connect.textContent = this.#isOn ? words.disconnect : words.connect;
    pause.textContent = this.#frozen === null ? words.pause : words.resume;
  }

  async #toggle() {
    if (this.#isOn) {
      await this.#ask('unwatch').catch(() => null);
      this.#leave(words.notWatching);
      return;
    }
    this.#tell(words.connecting);
    try {
      this.#begin(await this.#ask('watch', { namespace: this.#parts.namespace.value.trim() }));
    } catch (error) {
      this.#tell(error.message);
    }
  }

  #begin(plan) {
    const inputs = plan.inputs.map((item) => new Row(item.name, 'input', {
      ...item, isBool: item.isDiscrete && !Object.keys(item.names).length }));
    const rows = [...plan.requirements.map((item) => new Row(item.id, 'verdict')), ...inputs];
    this.#rows = new Map(rows.map((row) => [`${row.kind} ${row.name}`, row]));
    this.#health = {};
    this.#others = [];
    this.#command = plan.command;
    this.#violated.clear();
    this.#isOn = true;
    this.#frozen = this.#skew = null;
    this.#seen.disconnect();
    show(this.#parts.rows, ...rows.flatMap((row) => row.parts), h('span'),
      h('div', { class: 'scale ends', 'aria-hidden': 'true' }, this.#parts.begin,
        this.#parts.pointed, h('span', {}, words.now)));
    rows.forEach((row) => this.#seen.observe(row.picture));
    show(this.#parts.occurrences);
    show(this.#parts.health);
    show(this.#parts.monitor);
    this.#parts.note.textContent = plan.leftOut.length ? words.leftOut(plan.leftOut) : '';
    this.#tell(words.searching);
    this.#enable();
    clearInterval(this.#drawing);
    this.#drawing = setInterval(() => this.#draw(), 100);
  }

  #leave(text) {
    if (!this.#isOn) return;
    this.#isOn = false;
    this.#violated.clear();
    this.#broken([], []);
    clearInterval(this.#drawing);
    this.#tell(text);
    this.#enable();
  }

  #take(found) {
    if (!this.#isOn) return;
    if (found.error) {
      this.#leave(found.error);
      return;
    }
    for (const [id, changes] of Object.entries(found.verdicts ?? {})) {
      changes.forEach((change) => this.#note(`verdict ${id}`, change));
    }
    for (const [name, value] of Object.entries(found.values ?? {})) {
      this.#note(`input ${name}`, value);
    }
    for (const item of found.occurrences ?? []) this.#add(item);
    if (found.leftOut) this.#add({ note: words.more(found.leftOut) });
    for (const [name, value] of Object.entries(found)) {
      if (name.startsWith('health ')) this.#health[name.slice(7)] = value;
    }
    if (Object.keys(found).some((name) => name.startsWith('health '))) this.#showHealth();
    this.#others = found.others ?? this.#others;
    if (found.monitors || found.others) this.#showMonitors(found.monitors ?? []);
    if (found.missing?.length) {
      this.#parts.note.textContent += ` ${words.notInstalled(found.missing)}`;
    }
    if (found.told) this.#tell(found.told);
    this.#broken([...this.#violated].map((id) => id.split('[')[0]),
      Object.values(this.#health).flat().filter(({ level, name }) => level && TOPIC.test(name))
        .map(({ name }) => name.replace(TOPIC, '')));
  }

  #note(key, [time, value]) {
    const skew = time - Date.now();
    if (this.#skew === null || skew > this.#skew) this.#skew = skew;
    const row = this.#rows.get(key) ?? this.#instance(key);
    if (row?.kind === 'verdict') this.#violated[value === false ? 'add' : 'delete'](row.name);
    if (value !== null || row?.kind === 'verdict') row?.history.add(time, value);
  }

  // Add the row of an instance below its requirement; it is known from its first violation on.
  #instance(key) {
    const above = this.#rows.get(key.split('[')[0]);
    if (above?.kind !== 'verdict') return null;
    const row = new Row(key.slice('verdict '.length), 'verdict');
    this.#rows.set(key, row);
    above.parts.at(-1).after(...row.parts);
    this.#seen.observe(row.picture);
    return row;
  }

  #add(item) {
    const list = this.#parts.occurrences;
    const time = item.time ? new Date(item.time).toLocaleTimeString() : '';
    const values = (item.values ?? []).filter(
      ([name, value]) => !OF_ALL.includes(name) && (name !== 'silent' || value)).map(([name, value]) => `${name} = ${value}`).join(', ');
    list.prepend(h('li', { class: item.isOver ? 'is-over' : '' },
      item.note ?? h('strong', {}, item.id), item.note ? '' : ` ${
        item.isOver ? words.over : words.violated} ${time}`,
      item.text ? h('div', { class: 'help' }, item.text) : null,
      values ? h('div', { class: 'faint' }, values) : null));
    while (list.childElementCount > MOST_OCCURRENCES) list.lastElementChild.remove();
  }

  #showHealth() {
    const all = Object.entries(this.#health).flatMap(([node, items]) => items.map(
      (item) => ({ ...item, node }))).sort((a, b) => b.level - a.level);
    const figures = (item) => item.values.filter(([key]) => key !== 'text').map(
      ([key, value]) => `${key} ${value}`).join(', ');
    show(this.#parts.health, h('ul', {}, ...all.map((item) => h('li', {
      class: LEVELS[item.level] ?? 'is-bad' },
    h('span', { class: 'level' }, words.levels[item.level] ?? words.levels[2]),
    ' ', h('strong', {}, item.name), `: ${item.text}`,
    h('div', { class: 'faint' }, figures(item))))));
  }

  #showMonitors(names) {
    const gone = Object.keys(this.#health).filter((name) => !names.includes(`/${name}`));
    gone.forEach((name) => delete this.#health[name]);
    if (gone.length) this.#showHealth();
    show(this.#parts.monitor, ...names.map((name) => h('option', { value: name }, name)));
    this.#tell(names.length ? words.watching(names) : words.noMonitor);
    if (!names.length) this.#help();
    this.#enable();
  }

  // Say where else a monitor is, and how one is started.
  #help() {
    this.#parts.status.append(
      ...this.#others.map((name) => h('button', { type: 'button',
        onclick: () => this.#watch(name) }, words.watchIn(name))),
      ...(this.#command ? [h('div', {}, words.startOne, h('pre', {}, this.#command))] : []));
  }

  async #watch(namespace) {
    this.#parts.namespace.value = namespace;
    this.#leave(words.connecting);
    await this.#toggle();
  }

  // Values are of the time at which the pointer is.
  #point(event) {
    const box = event.target.closest('.lane')?.getBoundingClientRect();
    this.#pointed = box ? Math.max(0, Math.min(1, (event.clientX - box.left) / box.width)) : null;
  }

  #pause() {
    this.#frozen = this.#frozen === null ? this.#now : null;
    this.#enable();
    this.#draw();
  }

  async #reset() {
    await this.#ask('reset', { node: this.#parts.monitor.value }).catch(
      (error) => this.#tell(error.message));
  }

  get #now() { return Date.now() + (this.#skew ?? 0); }

  #draw() {
    if (document.hidden) return;
    const count = this.#span * 1000;
    const first = (this.#frozen ?? this.#now) - count;
    const pointed = this.#pointed === null ? null : first + this.#pointed * count;
    const view = { first, count, pointed, x: (time) => (time - first) * WIDTH / count };
    for (const row of this.#rows.values()) row.draw(view);
    this.#parts.begin.textContent = words.ago(this.#span);
    this.#parts.pointed.textContent = pointed === null ? '' : new Date(pointed).toLocaleTimeString();
    this.#place.dataset.drawn = String(Number(this.#place.dataset.drawn ?? 0) + 1);
  }

  #tell(text) { this.#parts.status.textContent = text; }
}
