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

/// main.c: runs the node as a process, until SIGINT or SIGTERM.
///
/// The exit status is 0 after a signal, 1 if the node cannot start, and 2 if it fails later; the
/// reason is on standard error.

#define _POSIX_C_SOURCE 200809L

#include <signal.h>
#include <string.h>

#include "monitor_node.h"

enum { FAILED = 2 };

static volatile sig_atomic_t is_over;

static void end(int number)
{
  (void)number;
  is_over = 1;
}

static void handle_signals(void)
{
  struct sigaction action;
  sigset_t handled;
  memset(&action, 0, sizeof(action));
  action.sa_handler = end;
  action.sa_flags = SA_RESTART;
  (void)sigaction(SIGINT, &action, NULL);
  (void)sigaction(SIGTERM, &action, NULL);
  (void)sigemptyset(&handled);
  (void)sigaddset(&handled, SIGINT);
  (void)sigaddset(&handled, SIGTERM);
  (void)sigprocmask(SIG_UNBLOCK, &handled, NULL);  // `monitor` blocks them until here
  action.sa_handler = SIG_IGN;  // the reader of the log may end before the node
  (void)sigaction(SIGPIPE, &action, NULL);
  (void)sigaction(SIGXFSZ, &action, NULL);  // a file that is too large is an error of a write
}

int main(int argc, char ** argv)
{
  static struct fm_monitor_node monitor;
  handle_signals();
  int status = fm_monitor_node_begin(
    &monitor, &fm_node_tables, argc, (const char * const *)argv);
  while (status == 0 && !is_over && rcl_context_is_valid(&monitor.node.context)) {
    status = fm_monitor_node_spin_once(&monitor) ? 0 : FAILED;
  }
  fm_monitor_node_end(&monitor);
  return status;
}
