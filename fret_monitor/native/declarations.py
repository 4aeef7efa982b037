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

"""
What Python calls of csrc, in C: the text that cffi reads.

It repeats the headers of csrc (a test compares sizes, offsets, values and signatures), and leaves
out what Python has no business with. Reading it takes cffi longer than all else at a start, so
what cffi makes of it is kept as `binding.py`. After a change:

    python3 -m fret_monitor.native.declarations
"""

from pathlib import Path
import tempfile

DECLARATIONS = """
void * dlopen(const char * file, int flags);
void * dlsym(void * library, const char * symbol);
int dlclose(void * library);
char * dlerror(void);

#define FM_ABI 1

enum fm_type
{
  FM_BOOL = 0,
  FM_INT8 = 1,
  FM_INT16 = 2,
  FM_INT32 = 3,
  FM_INT64 = 4,
  FM_UINT8 = 5,
  FM_UINT16 = 6,
  FM_UINT32 = 7,
  FM_UINT64 = 8,
  FM_FLOAT32 = 9,
  FM_FLOAT64 = 10
};

struct fm_input
{
  const char * name;
  uint32_t offset;
  uint8_t type;
};

struct fm_group
{
  const uint32_t * inputs;
  uint32_t n_inputs;
  const uint32_t * requirements;
  uint32_t n_requirements;
  void (* reset)(void * state);
  void (* step)(void * state, const void * inputs, bool * verdicts);
};

struct fm_requirement
{
  const char * id;
  uint32_t group;
};

struct fm_monitor
{
  uint32_t abi;
  uint32_t n_inputs;
  uint32_t n_groups;
  uint32_t n_requirements;
  uint64_t state_bytes;
  uint64_t inputs_bytes;
  const struct fm_input * inputs;
  const struct fm_group * groups;
  const struct fm_requirement * requirements;
  const char * name;
  const char * source_hash;
  void (* step)(void * state, const void * inputs, bool * verdicts);
};

union fm_value
{
  int64_t i;
  uint64_t u;
  double f;
};

enum fm_outcome
{
  FM_FIELD_READ = 0,
  FM_FIELD_OUTSIDE = 1,
  FM_FIELD_UNNAMED = 2,
  FM_FIELD_EMPTY = 3
};

struct fm_field
{
  union fm_value value;
  uint32_t outcome;
  uint32_t length;
};

struct fm_reader
{
  bool (* read)(const uint8_t * message, size_t size, struct fm_field * fields);
  uint32_t n_inputs;
};

struct fm_readers
{
  uint32_t abi;
  uint32_t n_topics;
  const struct fm_reader * topics;
};

enum fm_policy
{
  FM_EVERY_MESSAGE = 0,
  FM_RELEVANT_MESSAGE = 1,
  FM_ALL_INPUTS = 2,
  FM_PERIODIC = 3
};

struct fm_topic
{
  const uint32_t * inputs;
  uint32_t n_inputs;
};

struct fm_evaluator_options
{
  const struct fm_monitor * monitor;
  const struct fm_topic * topics;
  uint32_t n_topics;
  uint32_t policy;
  const bool * report_onset;
};

struct fm_violation
{
  uint64_t step;
  int64_t stamp;
  uint32_t requirement;
};

struct fm_requirement_counts
{
  uint64_t steps;
  uint64_t violations;
  uint64_t announced;
  bool verdict;
};

struct fm_input_counts
{
  uint64_t received;
  uint64_t unusable;
  uint64_t overwritten;
};

struct fm_topic_counts
{
  uint64_t messages;
  uint64_t undecodable;
};

struct fm_evaluator;

uint64_t fm_evaluator_bytes(const struct fm_evaluator_options * options);
struct fm_evaluator * fm_evaluator_init(
  void * memory, const struct fm_evaluator_options * options);
void fm_evaluator_store_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value);
void fm_evaluator_initial_from(
  struct fm_evaluator * evaluator, uint32_t input, const void * value);
void fm_evaluator_unusable(struct fm_evaluator * evaluator, uint32_t input);
void fm_evaluator_undecodable(struct fm_evaluator * evaluator, uint32_t topic);
uint32_t fm_evaluator_stale(
  struct fm_evaluator * evaluator, uint32_t input, uint64_t received, int64_t stamp,
  struct fm_violation * out);
uint32_t fm_evaluator_message(
  struct fm_evaluator * evaluator, uint32_t topic, int64_t stamp, struct fm_violation * out);
uint32_t fm_evaluator_tick(
  struct fm_evaluator * evaluator, int64_t stamp, struct fm_violation * out);
uint64_t fm_evaluator_rows(
  struct fm_evaluator * evaluator, const void * const * columns, uint64_t n_rows,
  bool * verdicts);
void fm_evaluator_reset(struct fm_evaluator * evaluator);
bool fm_evaluator_ready(const struct fm_evaluator * evaluator, uint32_t group);
uint64_t fm_evaluator_steps(const struct fm_evaluator * evaluator, uint32_t group);
const bool * fm_evaluator_verdicts(const struct fm_evaluator * evaluator);
const void * fm_evaluator_inputs(const struct fm_evaluator * evaluator);
bool fm_evaluator_has_value(const struct fm_evaluator * evaluator, uint32_t input);
bool fm_evaluator_is_stale(const struct fm_evaluator * evaluator, uint32_t input);
struct fm_requirement_counts fm_evaluator_requirement_counts(
  const struct fm_evaluator * evaluator, uint32_t requirement);
struct fm_input_counts fm_evaluator_input_counts(
  const struct fm_evaluator * evaluator, uint32_t input);
struct fm_topic_counts fm_evaluator_topic_counts(
  const struct fm_evaluator * evaluator, uint32_t topic);

struct fm_engine;

struct fm_engine_options
{
  struct fm_evaluator * evaluator;
  const struct fm_monitor * monitor;
  const struct fm_readers * readers;
  const struct fm_topic * topics;
  uint32_t n_topics;
};

struct fm_origin
{
  int64_t received;
  int64_t sent;
  uint64_t sequence;
  const uint8_t * gid;
  bool is_retired;
};

enum fm_receipt
{
  FM_RECEIVED = 0,
  FM_UNDECODABLE = 1,
  FM_REPEATED = 2
};

struct fm_detail
{
  struct fm_violation violation;
  uint64_t suppressed;
};

struct fm_engine * fm_engine_create(const struct fm_engine_options * options);
void fm_engine_destroy(struct fm_engine * engine);
void fm_engine_close(struct fm_engine * engine);
bool fm_engine_is_closed(struct fm_engine * engine);
uint32_t fm_engine_message(
  struct fm_engine * engine, uint32_t topic, const uint8_t * message, size_t size,
  const struct fm_origin * origin);
void fm_engine_tick(struct fm_engine * engine, int64_t stamp);
void fm_engine_stale(
  struct fm_engine * engine, uint32_t input, uint64_t received, int64_t stamp);
bool fm_engine_is_stale(struct fm_engine * engine, uint32_t input);
void fm_engine_reset(struct fm_engine * engine);
void fm_engine_use_clock(
  struct fm_engine * engine, int (* now)(void * clock, int64_t * nanoseconds), void * clock);
void fm_engine_begin_handover(struct fm_engine * engine, uint32_t topic, bool has_history);
void fm_engine_end_handover(struct fm_engine * engine, uint32_t topic);
uint32_t fm_engine_take(
  struct fm_engine * engine, struct fm_violation * out, uint32_t room, uint32_t milliseconds);
void fm_engine_want_details(struct fm_engine * engine, bool is_wanted, uint32_t most);
bool fm_engine_take_detail(
  struct fm_engine * engine, struct fm_detail * out, uint32_t milliseconds);
size_t fm_engine_evidence(
  struct fm_engine * engine, uint32_t topic, uint8_t * out, size_t room);
uint64_t fm_engine_lost(struct fm_engine * engine, uint32_t topic);
uint64_t fm_engine_unpublished(struct fm_engine * engine);
void fm_engine_count_unpublished(struct fm_engine * engine, uint64_t more);
struct fm_requirement_counts fm_engine_requirement_counts(
  struct fm_engine * engine, uint32_t requirement);
struct fm_input_counts fm_engine_input_counts(struct fm_engine * engine, uint32_t input);
struct fm_topic_counts fm_engine_topic_counts(struct fm_engine * engine, uint32_t topic);
bool fm_engine_value(struct fm_engine * engine, uint32_t input, void * out);

struct fm_serialized;
struct fm_message_info;
typedef void (* fm_on_message)(const void * user_data, size_t count);

struct fm_type_callbacks
{
  const char * message_namespace;
  const char * message_name;
  void * cdr_serialize;
  bool (* cdr_deserialize)(void * cdr, void * message);
  void * get_serialized_size;
  void * max_serialized_size;
  void * key_callbacks;
};

struct fm_type_support
{
  const char * typesupport_identifier;
  const struct fm_type_callbacks * data;
  const struct fm_type_support * (* func)(
    const struct fm_type_support * handle, const char * identifier);
  void * get_type_hash_func;
  void * get_type_description_func;
  void * get_type_description_sources_func;
};

struct fm_in_place_type
{
  struct fm_type_support support;
  const struct fm_type_support * original;
  struct fm_type_support fast;
  struct fm_type_callbacks callbacks;
};

struct fm_in_place
{
  size_t buffer_of_cdr;
  size_t data_of_buffer;
  size_t size_of_buffer;
};

struct fm_middleware
{
  int (* take)(
    const void * subscription, struct fm_serialized * message, bool * taken,
    struct fm_message_info * info, void * allocation);
  int (* listen)(void * subscription, fm_on_message callback, const void * user_data);
  int (* publish)(const void * publisher, const void * message, void * allocation);
  void (* forget_error)(void);
  bool (* has_error)(void);
  int (* take_message)(
    const void * subscription, void * message, bool * taken, struct fm_message_info * info,
    void * allocation);
  struct fm_in_place in_place;
};

bool fm_in_place_find(
  void (* make_buffer)(void * self, char * data, size_t size),
  void (* make_cdr)(void * self, void * buffer, int endianness, int version),
  struct fm_in_place * found);
bool fm_in_place_make(
  const struct fm_type_support * original, struct fm_in_place_type * made);
bool fm_in_place_read(void * cdr, void * source);

struct fm_receiver;
struct fm_receiver * fm_receiver_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * subscription,
  uint32_t topic, bool is_in_place);
void fm_receiver_drain(struct fm_receiver * source);
void fm_receiver_poll(struct fm_receiver * source);
void fm_receiver_retire(struct fm_receiver * source);
void fm_receiver_stop(struct fm_receiver * source);
struct fm_announcer;
struct fm_announcer * fm_announcer_start(
  struct fm_engine * engine, const struct fm_middleware * middleware, void * const * publishers,
  uint32_t n_publishers);
void fm_announcer_join(struct fm_announcer * announcer);
"""

_HEAD = '''# flake8: noqa
# ruff: noqa
# mypy: ignore-errors

"""What cffi makes of `declarations.py`; written by that module, not by hand."""

'''


def binding_text() -> str:
    """Return the text of `binding.py`, without its licence."""
    # Not at the top: a robot has `_cffi_backend` and need not load the parser of C.
    from cffi import FFI
    ffi = FFI()
    ffi.cdef(DECLARATIONS)
    ffi.set_source('fret_monitor.native.binding', None)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / 'binding.py'
        ffi.emit_python_code(str(made))
        text = made.read_text(encoding='utf-8')
    return _HEAD + text.removeprefix('# auto-generated file\n')


def write_binding() -> None:
    """Write `binding.py` anew, under the licence of this file."""
    here = Path(__file__)
    licence = here.read_text(encoding='utf-8').partition('\n"""')[0]
    here.with_name('binding.py').write_text(
        f'{licence}\n{binding_text()}', encoding='utf-8')


if __name__ == '__main__':
    write_binding()
