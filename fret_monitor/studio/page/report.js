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

// Parts of a report of `bag`: its HTML, drawn by its script (`rows.js`) in its style.

import { h } from './dom.js';

// Return an element with the HTML of a report; `data` has what is drawn in it.
export function report(html, data) {
  const host = h('div', { class: 'report' });
  const root = host.attachShadow({ mode: 'open' });
  const draw = () => globalThis.drawReport(root, data);
  const body = h('div');
  body.innerHTML = html; // escaped by the server
  root.append(h('link', { rel: 'stylesheet', href: 'report.css', onload: draw }), body);
  root.addEventListener('toggle', draw, true);
  root.addEventListener('click', (event) => {
    const link = event.target.closest('a[href^="#"]');
    if (!link) return;
    event.preventDefault();
    root.getElementById(link.getAttribute('href').slice(1))?.scrollIntoView();
  });
  let width = 0;
  new ResizeObserver(() => {
    if (host.clientWidth !== width) draw();
    width = host.clientWidth;
  }).observe(host);
  return host;
}
