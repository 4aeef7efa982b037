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

// Elements of the page.

const SVG = 'http://www.w3.org/2000/svg';

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, '');
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child != null));
  return element;
}

export function h(tag, attributes = {}, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

// The cell with the name of a row; `axis` is beside it, if it has numbers.
export function named(name, axis = null) {
  return h('span', { class: 'name', title: name }, h('span', {}, name), axis && axis.element);
}

// The greatest and the least number that a row has room for.
export class Axis {
  #ends = [h('span'), h('span')];
  element = h('span', { class: 'axis' }, ...this.#ends);

  show(least, greatest, digits = 3) {
    const text = (value) => Number.isFinite(value) ? String(Number(value.toPrecision(digits))) : '';
    this.#ends.forEach((end, number) => { end.textContent = text([greatest, least][number]); });
  }
}

export function show(place, ...children) {
  place.replaceChildren(...children.filter((child) => child != null));
}

// Markdown as hovers use it: paragraphs, `code`, **bold**, fences and lists.
export function markdown(text) {
  const box = h('div', { class: 'markdown' });
  for (const block of text.split(/\n{2,}/)) {
    const fence = block.match(/^```\w*\n([^]*?)\n?```$/);
    const lines = block.split('\n');
    if (fence) box.append(h('pre', {}, fence[1]));
    else if (lines.every((line) => /^[-*] /.test(line))) {
      box.append(h('ul', {}, ...lines.map((line) => h('li', {}, ...inline(line.slice(2))))));
    } else box.append(h('p', {}, ...inline(block)));
  }
  return box;
}

function inline(text) {
  return text.split(/(`[^`]+`|\*\*[^*]+\*\*)/).filter(Boolean).map((part) => {
    if (part.startsWith('`')) return h('code', {}, part.slice(1, -1));
    if (part.startsWith('**')) return h('strong', {}, part.slice(2, -2));
    return document.createTextNode(part);
  });
}
