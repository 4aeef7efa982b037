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

// Texts that are not saved, in the browser's storage: one of a file for each tab.

const LOCK = 'fret_monitor '; // a tab holds the one of its name as long as it is open
const ALL = 'fret_monitor drafts';
const WAIT_MS = 3000; // the page before a reload holds its lock for a moment

export class Drafts {
  #tab = null;
  #ready = this.#begin();

  async #begin() {
    const known = sessionStorage.getItem('tab'); // a tab that is duplicated has it, too
    this.#tab = known && await hold(LOCK + known, AbortSignal.timeout(WAIT_MS)) ? known : crypto.randomUUID();
    sessionStorage.setItem('tab', this.#tab);
    if (this.#tab !== known) await hold(LOCK + this.#tab);
  }

  #key(file, tab = this.#tab) { return `draft ${tab} ${file}`; }

  // Keep a text, and the stamp of the file that was changed; return whether there is room.
  keep(file, text, stamp) {
    try {
      localStorage.setItem(this.#key(file), JSON.stringify({ text, stamp, time: Date.now() }));
      return true;
    } catch {
      return false;
    }
  }

  drop(file) { localStorage.removeItem(this.#key(file)); }

  // Return what this tab has not saved of a file, or else the newest text of a tab that is closed,
  // which is this tab's from now on; how many of those there are besides; and whether a tab that
  // is open has one.
  async take(file) {
    await this.#ready;
    return navigator.locks.request(ALL, async () => {
      const { held } = await navigator.locks.query();
      const isOpen = (tab) => held.some(({ name }) => name === LOCK + tab);
      const found = (tab) => parsed(localStorage.getItem(this.#key(file, tab)));
      const tabs = Object.keys(localStorage).map((key) => key.split(' ')[1])
        .filter((tab) => tab !== this.#tab && found(tab));
      const closed = tabs.filter((tab) => !isOpen(tab));
      let draft = found(this.#tab);
      if (!draft && closed.length) {
        const [last] = closed.sort((one, other) => found(other).time - found(one).time).splice(0, 1);
        draft = found(last);
        localStorage.removeItem(this.#key(file, last)); // first: there may be no room for two
        this.keep(file, draft.text, draft.stamp);
      }
      return { draft, more: closed.length, isElsewhere: tabs.some(isOpen) };
    });
  }
}

// The value of a text; null if it is none, or damaged.
function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

// Hold a lock until the tab is closed; false: another tab had it until the signal came.
function hold(name, signal) {
  return new Promise((resolve) => {
    navigator.locks.request(name, { signal }, () => {
      resolve(true);
      return new Promise(() => {});
    }).catch(() => resolve(false));
  });
}
