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

// Calls the ports of a component of target `fprime`. A line of standard input has the time in
// microseconds, a port, and its arguments. Events and telemetry are printed by the stubs.

#include "components.inc"

I64 nowInMicroseconds;

int main(int n_arguments, char ** arguments)
{
  assert(n_arguments == 2);
  Fw::PassiveComponentBase & component = *components()[std::stoul(arguments[1])];
  std::string port;
  while (std::cin >> nowInMicroseconds >> port) {
    component.call(port);
  }
  return 0;
}
