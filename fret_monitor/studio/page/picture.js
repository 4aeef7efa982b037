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

// A bundle as a picture: what is read from where, and what it causes.

import { h, show, svg } from './dom.js';
import { words } from './words.js';

const KINDS = ['topic', 'input', 'definition', 'requirement', 'action'];
const [WIDTH, HEIGHT, GAP, ROW] = [176, 24, 64, 32];
const PAUSE_MS = 400;
const LETTERS = 22; // of a name that fit into a node

export class Picture {
  #place;
  #ask;
  #go;
  #nodes = [];
  #active = 0;
  #pause = 0;
  #broken = {};
  #isSeen = false;
  #isOld = false; // it is drawn when it is near the window

  // `go(offset)` shows a place in the editor.
  constructor(place, ask, go) {
    this.#place = place;
    this.#ask = ask;
    this.#go = go;
    new IntersectionObserver(([entry]) => {
      this.#isSeen = entry.isIntersecting;
      this.#load();
    }, { rootMargin: '2000px' }).observe(place);
  }

  // Mark what is broken in a monitor that is watched: requirements, and topics by their full names.
  mark(requirements, topics) {
    this.#broken = { requirement: (name) => requirements.includes(name),
      topic: (name) => topics.some((each) => `/${each}`.endsWith(`/${name.replace(/^\//, '')}`)) };
    this.#nodes.forEach((node) => this.#show(node));
  }

  #show(node) {
    const isBroken = this.#broken[node.kind]?.(node.name) ?? false;
    if (node.isBroken === isBroken) return;
    node.isBroken = isBroken;
    node.shown.lastChild.textContent = short(node);
    node.shown.classList.toggle('broken', isBroken);
    node.shown.setAttribute('aria-label',
      [label(node, this.#nodes), isBroken && words.brokenNow].filter(Boolean).join('; '));
  }

  // Draw the bundle that is in the editor, when nothing has been typed for a while.
  use() {
    clearTimeout(this.#pause);
    this.#pause = setTimeout(() => {
      this.#isOld = true;
      this.#load();
    }, PAUSE_MS);
  }

  async #load() {
    if (!this.#isSeen || !this.#isOld) return;
    this.#isOld = false;
    const found = await this.#ask('picture').catch(() => null);
    if (!found) return;
    const columns = KINDS.map((kind) => found.nodes.map((node, number) => ({ ...node, number }))
      .filter((node) => node.kind === kind || (kind === 'action' && node.kind === 'gate')))
      .filter((column) => column.length);
    this.#nodes = arranged(columns, found.links, found.nodes.length);
    this.#active = Math.min(this.#active, Math.max(0, this.#nodes.length - 1));
    this.#draw(found.links, columns);
  }

  #draw(links, columns) {
    const most = Math.max(1, ...columns.map((column) => column.length));
    const width = columns.length * (WIDTH + GAP) - GAP;
    const drawn = svg('svg', {
      class: 'picture', viewBox: `0 0 ${Math.max(WIDTH, width)} ${most * ROW + ROW}`,
      width: Math.max(WIDTH, width), height: most * ROW + ROW, role: 'group',
      'aria-label': words.pictureLabel,
      onkeydown: (event) => this.#key(event) },
    ...columns.map((column, place) => svg('text', { x: place * (WIDTH + GAP), y: 14, class: 'head' },
      words.pictureKinds[column[0].kind])));
    for (const [from, to] of links) {
      const [begin, end] = [this.#nodes[from], this.#nodes[to]];
      const [x, y] = [begin.x + WIDTH, begin.y + HEIGHT / 2];
      const [X, Y] = [end.x, end.y + HEIGHT / 2];
      const path = end.column > begin.column
        ? `M${x} ${y}C${x + GAP / 2} ${y} ${X - GAP / 2} ${Y} ${X} ${Y}`
        : `M${x} ${y}C${x + GAP / 2} ${y} ${x + GAP / 2} ${Y} ${X + WIDTH} ${Y}`;
      const link = svg('path', { class: 'link', d: path, 'aria-hidden': 'true' });
      begin.links.push(link);
      end.links.push(link);
      drawn.append(link);
    }
    drawn.append(...this.#nodes.map((node) => this.#node(node)));
    show(this.#place, drawn);
  }

  #node(node) {
    node.shown = svg('g', {
      class: `node of-${node.kind} ${node.level ?? ''}`, role: 'button',
      tabindex: node === this.#nodes[this.#active] ? 0 : -1, 'aria-label': label(node, this.#nodes),
      transform: `translate(${node.x} ${node.y})`,
      onclick: () => this.#open(node), onfocus: () => this.#mark(node, true),
      onblur: () => this.#mark(node, false), onpointerenter: () => this.#mark(node, true),
      onpointerleave: () => this.#mark(node, false) },
    svg('title', {}, [node.name, node.detail].filter(Boolean).join('\n')),
    svg('rect', { width: WIDTH, height: HEIGHT, rx: 5 }),
    svg('text', { x: 8, y: 16 }, short(node)));
    this.#show(node);
    return node.shown;
  }

  #mark(node, isMarked) {
    node.links.forEach((link) => link.classList.toggle('marked', isMarked));
    if (isMarked) node.links.forEach((link) => link.parentNode.querySelector('.node').before(link));
  }

  #open(node) {
    if (node.from !== null) this.#go(node.from);
  }

  // Arrows go up and down in a column, and along the links to the left and to the right.
  #key(event) {
    const node = this.#nodes.find((each) => each.shown === document.activeElement);
    if (!node) return;
    const column = this.#nodes.filter((each) => each.column === node.column)
      .sort((a, b) => a.y - b.y);
    const beside = (by) => column[column.indexOf(node) + by];
    const to = { ArrowUp: () => beside(-1), ArrowDown: () => beside(1),
      ArrowLeft: () => this.#nodes[node.sources[0]],
      ArrowRight: () => this.#nodes[node.targets[0]],
      Home: () => column[0], End: () => column.at(-1) }[event.key]?.();
    if (event.key === 'Enter' || event.key === ' ') this.#open(node);
    else if (to) {
      node.shown.setAttribute('tabindex', -1);
      to.shown.setAttribute('tabindex', 0);
      this.#active = to.number;
      to.shown.focus();
    } else return;
    event.preventDefault();
  }
}

// The name as it has room, with a mark if something is wrong.
function short(node) {
  const name = node.name.length > LETTERS ? `${node.name.slice(0, LETTERS - 1)}…` : node.name;
  return node.level || node.isBroken ? `! ${name}` : name;
}

function label(node, nodes) {
  const names = (numbers) => numbers.map((number) => nodes[number].name).join(', ');
  return words.pictureNode(words.pictureKind[node.kind], node.name, node.detail,
    names(node.sources), names(node.targets), node.level);
}

// Return the nodes with their places; in a column near to what they are linked with.
function arranged(columns, links, count) {
  const nodes = new Array(count);
  const sources = Array.from({ length: count }, () => []);
  const targets = Array.from({ length: count }, () => []);
  for (const [from, to] of links) {
    targets[from].push(to);
    sources[to].push(from);
  }
  columns.forEach((column, place) => {
    const mean = (node) => {
      const rows = sources[node.number].map((each) => nodes[each]?.y).filter(Number.isFinite);
      return rows.length ? rows.reduce((a, b) => a + b) / rows.length : Infinity;
    };
    const order = column.map((node) => [mean(node), node]).sort((a, b) => (a[0] > b[0])
      - (a[0] < b[0]) || a[1].number - b[1].number);
    order.forEach(([, node], row) => {
      nodes[node.number] = { ...node, column: place, x: place * (WIDTH + GAP), y: row * ROW + ROW,
        sources: sources[node.number], targets: targets[node.number], links: [] };
    });
  });
  return nodes;
}
