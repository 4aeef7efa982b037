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

# Make .venv, an environment in which fret_monitor runs: `sh tools/setup.sh run|test|kilted`.
#
# On a ROS 2 installation that is sourced, the environment stands on its Python and its packages;
# elsewhere the wheels of ROS 2 Jazzy are installed from PyPI. `test` adds what the tests need.
# `kilted` makes another one, .venv-kilted, for the tests on the wheels of ROS 2 Kilted.
# A second run does nothing; after an interrupted one, the next starts over.

set -eu
cd "$(dirname "$0")/.."
purpose=${1:-run}
venv=.venv
wheels=ros
if test "$purpose" = kilted; then
  venv=.venv-kilted
  wheels=ros-kilted
fi

fail() {
  printf 'fret_monitor: %s\n' "$*" >&2
  exit 1
}

is_312() {
  # A shim of pyenv is found on the path and still fails, so ask the interpreter itself.
  "$1" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 12))' >/dev/null 2>&1
}

# Print the Python 3.12s that there may be, likeliest first, one a line.
candidates() {
  command -v python3.12 || true
  command -v python3 || true
  # With Debian's pyenv, or another HOME, pyenv is found only by its shims on PATH.
  shims=$(printf '%s' "$PATH" | tr ':' '\n' | sed -n 's,/shims/*$,,p')
  printf '%s\n' "${PYENV_ROOT:-}" "${HOME:-}/.pyenv" "$shims" | while IFS= read -r root; do
    for python in "$root"/versions/3.12*/bin/python3.12; do
      if test -n "$root" && test -x "$python"; then echo "$python"; fi
    done
  done
  if command -v uv >/dev/null 2>&1; then uv python find 3.12 2>/dev/null || true; fi
}

find_wheels_python() {
  candidates | while IFS= read -r python; do
    if is_312 "$python"; then
      echo "$python"
      break
    fi
  done
}

find_ros_python() {
  # Packages of a ROS 2 installation fit one Python: the one it was made for.
  if python3 -c 'import sys, rclpy; sys.exit(sys.version_info < (3, 12))' >/dev/null 2>&1; then
    command -v python3
  fi
}

find_compiler() {
  for compiler in ${CC:+"${CC%% *}"} cc gcc clang; do
    if command -v "$compiler" >/dev/null 2>&1; then return; fi
  done
  fail 'no C compiler found: install one (on Ubuntu and Debian: sudo apt install gcc libc6-dev)' \
    'or name yours in CC.'
}

# What the environment was made from; when this changes, it is remade.
fingerprint() {
  printf '%s|%s|%s\n' "$PWD" "$ros" "$1"
  cat package.xml pyproject.toml setup.cfg setup.py tools/setup.sh
  ls launch
}

is_ready() {
  test -f "$venv/.ready.$purpose" && fingerprint "$purpose" | cmp -s - "$venv/.ready.$purpose" \
    && "$venv/bin/python" -S -c '' >/dev/null 2>&1
}

# pip takes a half-copied package for installed, so start over after an interruption.
is_whole() {
  is_312 "$venv/bin/python" && test ! -e "$venv/.unfinished" \
    && test "$(cat "$venv/.base" 2>/dev/null)" = "$PWD|$ros"
}

choose_python() {
  if test -n "$ros"; then
    python=$(find_ros_python)
    test -n "$python" || fail "ROS 2 ${ROS_DISTRO:-} is sourced, and its python3 is no Python 3.12" \
      'with rclpy: source ROS 2 Jazzy or newer, or use a shell in which none is sourced.'
    return
  fi
  python=$(find_wheels_python)
  test -n "$python" || fail 'no Python 3.12 found: install it (on Ubuntu 24.04:' \
    'sudo apt install python3.12-venv; elsewhere: uv python install 3.12, or pyenv install 3.12).'
}

make_venv() {
  echo "fret_monitor: making $venv with $python, which takes a minute"
  "$python" -c 'import ensurepip, venv' >/dev/null 2>&1 || fail "$python cannot make virtual" \
    'environments: install the rest of it (on Ubuntu and Debian: sudo apt install python3.12-venv).'
  # System packages, apt's cffi among them, belong to a ROS 2 installation only.
  rm -rf "$venv"
  "$python" -m venv ${ros:+--system-site-packages} "$venv"
  printf '%s\n' "$PWD|$ros" >"$venv/.base"
}

# The hundred packages of the tests take pip a minute, and uv ten seconds. pip takes over where uv
# fails, as it also says why; for the tests it compiles no module: most are never imported.
pip_install() {
  if test "$purpose" != run; then
    if test -z "$ros" && uv_install "$@"; then return; fi
    set -- --no-compile "$@"
  fi
  "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
}

uv_install() {
  "$venv/bin/python" -m pip install --quiet --disable-pip-version-check uv >/dev/null 2>&1 \
    && "$venv/bin/python" -m uv pip install --quiet --python "$venv/bin/python" "$@" 2>/dev/null
}

# `compat` puts the folder itself on the path: quicker to start than a finder of setuptools.
install_project() {
  pip_install --config-settings editable_mode=compat "$@"
}

install_packages() {
  if test -z "$ros" && test "$purpose" = run; then
    install_project -e '.[ros]'
  elif test -z "$ros"; then
    install_project -e ".[$wheels,$wheels-test,test]"
  elif "$venv/bin/python" -c 'import cffi, yaml' >/dev/null 2>&1; then
    # What apt installed is not to be shadowed by other releases from PyPI.
    install_project --no-deps -e .
  else
    install_project -e .
  fi
  if test -n "$ros" && test "$purpose" = test; then install_test_tools; fi
}

install_test_tools() {
  "$venv/bin/python" -c "
from importlib.metadata import requires
tools = [line.split(';')[0] for line in requires('fret_monitor') if line.endswith('== \"test\"')]
print(*tools, sep='\n')" >"$venv/test-tools.txt"
  pip_install -r "$venv/test-tools.txt"
}

# What colcon --symlink-install does and pip does not: programs where `ros2 run` looks for them, data
# files and the ament index where ROS looks for them, each a link, so that a developer's edits count.
# `ros2 launch` does not look into a folder that is a link: `launch` is a folder of links.
link_folders() {
  share=$venv/share/fret_monitor
  index=$venv/share/ament_index/resource_index/packages
  rm -rf "$share" "$venv/lib/fret_monitor"
  mkdir -p "$share/launch" "$venv/lib/fret_monitor" "$index"
  for program in fret-monitor gate logger monitor; do
    ln -s "../../bin/$program" "$venv/lib/fret_monitor/$program"
  done
  for shared in package.xml config csrc docs examples; do
    ln -s "../../../$shared" "$share/$shared"
  done
  for file in launch/*; do
    ln -s "../../../../$file" "$share/$file"
  done
  ln -sf ../../../../../resource/fret_monitor "$index/fret_monitor"
}

ros=
if test "$purpose" != kilted && test -n "${ROS_DISTRO:-}" && test -n "${AMENT_PREFIX_PATH:-}"; then ros=$ROS_DISTRO; fi
find_compiler
if is_ready; then exit 0; fi
choose_python
if ! is_whole; then make_venv; fi
: >"$venv/.unfinished"
install_packages
link_folders
rm "$venv/.unfinished"
# Whoever is ready for the tests is ready to run.
fingerprint run >"$venv/.ready.run"
fingerprint "$purpose" >"$venv/.ready.$purpose"
echo "fret_monitor: $venv is ready"
