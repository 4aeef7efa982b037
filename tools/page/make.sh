#!/bin/sh
# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

# Make fret_monitor/studio/page/vendor from the packages that package-lock.json names, with Node.js.
# The same versions give the same bytes. Run it from the top of the project: sh tools/page/make.sh
set -e
out="$PWD/fret_monitor/studio/page/vendor"
cd tools/page
npm ci --silent --ignore-scripts
npx esbuild entry.js --bundle --minify --format=esm --charset=utf8 --legal-comments=none \
  --log-level=warning --outfile="$out/codemirror.js"
{
  echo 'codemirror.js is made of these packages by tools/page/make.sh:'
  for folder in node_modules/@codemirror/* node_modules/@lezer/* node_modules/@marijn/* \
      node_modules/crelt node_modules/style-mod node_modules/w3c-keyname; do
    node -p "const p = require('./$folder/package.json'); '\n' + p.name + ' ' + p.version + '\n'"
    cat "$folder/LICENSE"
  done
} > "$out/LICENSES.txt"
cd "$out" && sha256sum codemirror.js > SHA256SUMS
