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

// Questions to the server, over one WebSocket.

export const OUTDATED = 'outdated';

export class Talk extends EventTarget {
  #waiting = new Map();
  #next = 1;
  #socket = null;
  #queue = [];

  constructor() {
    super();
    this.#connect();
  }

  get isOpen() {
    return this.#socket.readyState === WebSocket.OPEN;
  }

  // Return a promise of the answer; it fails with the server's reason.
  ask(what, question = {}) {
    return new Promise((resolve, reject) => {
      const id = this.#next++;
      this.#waiting.set(id, { resolve, reject });
      const text = JSON.stringify({ ...question, do: what, number: id });
      if (this.isOpen) this.#socket.send(text);
      else if (this.#socket.readyState === WebSocket.CONNECTING) this.#queue.push(text);
      else this.#fail(id, 'no server');
    });
  }

  #connect() {
    const address = new URL('talk', location.href);
    address.protocol = 'ws:';
    this.#socket = new WebSocket(address);
    this.#socket.addEventListener('open', () => {
      this.#queue.splice(0).forEach((text) => this.#socket.send(text));
      this.dispatchEvent(new Event('open'));
    });
    this.#socket.addEventListener('message', (event) => this.#hear(JSON.parse(event.data)));
    this.#socket.addEventListener('close', () => {
      [...this.#waiting.keys()].forEach((id) => this.#fail(id, 'no server'));
      this.dispatchEvent(new Event('close'));
      setTimeout(() => this.#connect(), 2000);
    });
  }

  #hear(found) {
    const pushed = ['changed', 'gone', 'live', 'recordings'].find((kind) => kind in found);
    if (pushed) {
      this.dispatchEvent(new CustomEvent(pushed, { detail: found[pushed] }));
      return;
    }
    const waiting = this.#waiting.get(found.number);
    this.#waiting.delete(found.number);
    if (waiting && 'error' in found) waiting.reject(new Error(found.error));
    else if (waiting) waiting.resolve(found.answer);
  }

  #fail(id, reason) {
    this.#waiting.get(id)?.reject(new Error(reason));
    this.#waiting.delete(id);
  }
}
