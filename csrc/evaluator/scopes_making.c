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

/// scopes_making.c: the memory of scopes, and what their options must satisfy.

#include <string.h>

#include "scopes_parts.h"

// ---- layout ------------------------------------------------------------------------------------

// Offsets of the parts of the memory, in bytes.
struct layout
{
  uint64_t kinds;
  uint64_t totals;
  uint64_t steps;
  uint64_t topics;
  uint64_t topic_inputs;
  uint64_t staged;
  uint64_t parts;
  uint64_t found;
  uint64_t stepped;
  uint64_t copies;
  uint64_t maps;     // of the parts of each kind with a base
  uint64_t waiting;  // of each kind that reads aggregates
  uint64_t bundle;
  uint64_t pools;    // then the aggregates
  struct fm_block block;
};

static const struct fm_output * output_of(
  const struct fm_scopes_options * options, const struct fm_aggregate * aggregate)
{
  const struct fm_outputs * outputs = options->kinds[aggregate->kind].outputs;
  return aggregate->operation <= FM_ALL_OF ? NULL : &outputs->outputs[aggregate->operand];
}

static uint32_t group_of(
  const struct fm_scopes_options * options, const struct fm_aggregate * aggregate)
{
  const struct fm_monitor * monitor = options->kinds[aggregate->kind].options->monitor;
  const struct fm_output * output = output_of(options, aggregate);
  return output != NULL ? output->group : monitor->requirements[aggregate->operand].group;
}

static uint64_t bytes_of_aggregate(
  const struct fm_scopes_options * options, const struct fm_aggregate * aggregate)
{
  return fm_total_bytes(
    aggregate, output_of(options, aggregate), options->kinds[aggregate->kind].most);
}

static bool lists(const struct fm_topic * topic, uint32_t input)
{
  for (uint32_t k = 0; k < topic->n_inputs; ++k) {
    if (topic->inputs[k] == input) {
      return true;
    }
  }
  return false;
}

// Whether a group of the operand reads an input of a topic, or no input at all.
static bool feeds(
  const struct fm_scopes_options * options, uint32_t topic, const struct fm_aggregate * aggregate)
{
  const struct fm_evaluator_options * kind = options->kinds[aggregate->kind].options;
  const struct fm_group * group = &kind->monitor->groups[group_of(options, aggregate)];
  for (uint32_t k = 0; k < group->n_inputs; ++k) {
    if (lists(&kind->topics[topic], group->inputs[k])) {
      return true;
    }
  }
  return group->n_inputs == 0;
}

static uint32_t count_topic_inputs(const struct fm_scopes_options * options, uint32_t topic)
{
  uint32_t n = options->bundle->topics[topic].n_inputs;
  for (uint32_t a = 0; a < options->n_aggregates; ++a) {
    n += feeds(options, topic, &options->aggregates[a]) ? 1u : 0u;
  }
  return n;
}

static uint64_t most_requirements(const struct fm_scopes_options * options)
{
  uint64_t most = options->bundle->monitor->n_requirements;
  for (uint32_t k = 0; k < options->n_kinds; ++k) {
    const uint32_t n = options->kinds[k].options->monitor->n_requirements;
    most = n > most ? n : most;
  }
  return most;
}

static bool reads_aggregates(const struct fm_kind * kind)
{
  const uint8_t * sources = kind->options->sources;
  for (uint32_t i = 0; sources != NULL && i < kind->options->monitor->n_inputs; ++i) {
    if (sources[i] == FM_AGGREGATE) {
      return true;
    }
  }
  return false;
}

static uint32_t inputs_of_base(
  const struct fm_scopes_options * options, const struct fm_kind * kind)
{
  return kind->of_base == NULL ? 0 : options->kinds[kind->base].options->monitor->n_inputs;
}

static uint64_t waiting_of(const struct fm_kind * kind)
{
  return reads_aggregates(kind) || kind->halves != NULL ? kind->most : 0;
}

static uint64_t most_inputs(const struct fm_scopes_options * options)
{
  uint64_t most = 0;
  for (uint32_t k = 0; k < options->n_kinds; ++k) {
    const uint32_t n = options->kinds[k].options->monitor->n_inputs;
    most = n > most ? n : most;
  }
  return most;
}

// Each aggregate may put each group on the list of each topic.
static uint64_t bundle_bytes(const struct fm_scopes_options * options)
{
  const uint64_t plain = fm_evaluator_bytes(options->bundle);
  const struct fm_evaluator_options * bundle = options->bundle;
  struct fm_block block = {plain, plain > 0};
  (void)fm_block_append(
    &block, (uint64_t)bundle->n_topics * options->n_aggregates,
    bundle->monitor->n_groups * sizeof(uint32_t) + FM_ALIGNMENT);
  return block.fits ? block.bytes : 0;
}

static uint64_t pool_bytes(const struct fm_kind * kind)
{
  return fm_pool_bytes(kind->options, kind->most, kind->of_base == NULL, kind->forget > 0);
}

static uint64_t pairs_bytes(const struct fm_kind * kind)
{
  return kind->halves == NULL || kind->of_base != NULL ? 0 :
         fm_pairs_bytes(kind->halves, kind->most);
}

static struct layout lay_out(const struct fm_scopes_options * options)
{
  const struct fm_monitor * monitor = options->bundle->monitor;
  struct layout layout = {0};
  struct fm_block * block = &layout.block;
  uint64_t topic_inputs = 0, maps = 0, waiting = 0;
  for (uint32_t t = 0; t < options->bundle->n_topics; ++t) {
    topic_inputs += count_topic_inputs(options, t);
  }
  for (uint32_t k = 0; k < options->n_kinds; ++k) {
    maps += inputs_of_base(options, &options->kinds[k]);
    waiting += waiting_of(&options->kinds[k]);
  }
  block->fits = bundle_bytes(options) > 0;
  (void)fm_block_append(block, 1, sizeof(struct fm_scopes));
  layout.kinds = fm_block_append(block, options->n_kinds, sizeof(struct fm_scope_kind));
  layout.totals = fm_block_append(block, options->n_aggregates, sizeof(struct fm_total));
  layout.steps = fm_block_append(block, options->n_aggregates, sizeof(uint64_t));
  layout.topics = fm_block_append(block, options->bundle->n_topics, sizeof(struct fm_topic));
  layout.topic_inputs = fm_block_append(block, topic_inputs, sizeof(uint32_t));
  layout.staged = fm_block_append(block, monitor->n_inputs, sizeof(struct fm_staged));
  layout.parts = fm_block_append(block, most_inputs(options), sizeof(struct fm_staged));
  layout.found =
    fm_block_append(block, most_requirements(options), sizeof(struct fm_violation));
  layout.stepped = fm_block_append(block, options->most_stepped, sizeof(struct fm_stepped));
  layout.copies = fm_block_append(
    block, (uint64_t)options->n_kinds * monitor->n_inputs, sizeof(uint32_t));
  layout.maps = fm_block_append(block, maps, sizeof(uint32_t));
  layout.waiting = fm_block_append(block, waiting, sizeof(uint32_t));
  layout.bundle = fm_block_append(block, bundle_bytes(options), 1);
  layout.pools = block->bytes;
  for (uint32_t k = 0; k < options->n_kinds; ++k) {
    const uint64_t bytes = pool_bytes(&options->kinds[k]);
    block->fits = block->fits && bytes > 0;
    (void)fm_block_append(block, bytes, 1);
    (void)fm_block_append(block, pairs_bytes(&options->kinds[k]), 1);
  }
  for (uint32_t a = 0; a < options->n_aggregates; ++a) {
    (void)fm_block_append(block, bytes_of_aggregate(options, &options->aggregates[a]), 1);
  }
  return layout;
}

// ---- checks ------------------------------------------------------------------------------------

// A base comes before the kind, and has the same keys and the inputs with a key.
static bool base_is_sound(const struct fm_scopes_options * options, uint32_t k)
{
  const struct fm_kind * kind = &options->kinds[k];
  if (kind->of_base == NULL) {
    return true;
  }
  const struct fm_kind * base = kind->base < k ? &options->kinds[kind->base] : NULL;
  if (base == NULL || base->of_base != NULL || base->most != kind->most || kind->n_listed > 0) {
    return false;
  }
  for (uint32_t i = 0; i < kind->options->monitor->n_inputs; ++i) {
    const uint32_t b = kind->of_base[i];
    if (kind->shared[i] == UINT32_MAX && (b >= base->options->monitor->n_inputs ||
      base->options->monitor->inputs[b].type != kind->options->monitor->inputs[i].type))
    {
      return false;
    }
  }
  return true;
}

// The kind of a half has no base, is of one variable, and has the inputs.
static bool half_is_sound(
  const struct fm_scopes_options * options, const struct fm_kind * kind,
  const struct fm_half * half)
{
  if (half->most == 0 || half->kind == FM_BUNDLE) {
    return half->most > 0;
  }
  const struct fm_kind * single = half->kind < options->n_kinds ? &options->kinds[half->kind] :
    NULL;
  if (single == NULL || single->of_base != NULL || single->halves != NULL) {
    return false;
  }
  for (uint32_t i = 0; i < kind->options->monitor->n_inputs; ++i) {
    const uint32_t b = half->inputs[i];
    if (b != UINT32_MAX && (b >= single->options->monitor->n_inputs ||
      single->options->monitor->inputs[b].type != kind->options->monitor->inputs[i].type))
    {
      return false;
    }
  }
  return true;
}

static bool pairs_are_sound(const struct fm_scopes_options * options, const struct fm_kind * kind)
{
  return kind->halves == NULL || (
    (kind->of_base == NULL) == (pairs_bytes(kind) > 0) &&
    half_is_sound(options, kind, &kind->halves[0]) &&
    half_is_sound(options, kind, &kind->halves[1]));
}

// The operands of the aggregates that a kind reads are in kinds before it.
static bool order_is_sound(const struct fm_scopes_options * options, uint32_t k)
{
  const struct fm_kind * kind = &options->kinds[k];
  for (uint32_t i = 0; i < kind->options->monitor->n_inputs; ++i) {
    for (uint32_t a = 0; a < options->n_aggregates; ++a) {
      if (kind->shared[i] == options->aggregates[a].input && options->aggregates[a].kind >= k) {
        return false;
      }
    }
  }
  return true;
}

static bool kind_is_sound(const struct fm_scopes_options * options, const struct fm_kind * kind)
{
  const struct fm_evaluator_options * bundle = options->bundle;
  const struct fm_monitor * monitor = kind->options->monitor;
  if (monitor == NULL || monitor->abi != FM_ABI || kind->most == 0 ||
    kind->options->policy != bundle->policy || kind->options->n_topics != bundle->n_topics)
  {
    return false;
  }
  for (uint32_t i = 0; i < monitor->n_inputs; ++i) {
    const uint32_t b = kind->shared[i];
    if (b != UINT32_MAX && (b >= bundle->monitor->n_inputs ||
      bundle->monitor->inputs[b].type != monitor->inputs[i].type))
    {
      return false;
    }
  }
  return true;
}

static bool output_is_sound(
  const struct fm_monitor * monitor, const struct fm_output * output, uint8_t type)
{
  return output->group < monitor->n_groups && output->offset % sizeof(int64_t) == 0 &&
         output->offset + sizeof(int64_t) <= monitor->state_bytes && output->type == type &&
         (type == FM_INT64 || type == FM_UINT64 || type == FM_FLOAT64);
}

static bool aggregate_is_sound(
  const struct fm_scopes_options * options, const struct fm_aggregate * aggregate)
{
  const struct fm_evaluator_options * bundle = options->bundle;
  if (aggregate->kind >= options->n_kinds || aggregate->operation > FM_SUM_OF ||
    aggregate->input >= bundle->monitor->n_inputs || bundle->sources == NULL ||
    bundle->sources[aggregate->input] != FM_AGGREGATE)
  {
    return false;
  }
  const struct fm_kind * kind = &options->kinds[aggregate->kind];
  const struct fm_monitor * monitor = kind->options->monitor;
  const uint8_t type = bundle->monitor->inputs[aggregate->input].type;
  if (aggregate->operation > FM_ALL_OF) {
    return kind->outputs != NULL && aggregate->operand < kind->outputs->n_outputs &&
           output_is_sound(
      monitor, &kind->outputs->outputs[aggregate->operand],
      type == FM_FLOAT32 ? FM_FLOAT64 : type);
  }
  return aggregate->operand < monitor->n_requirements && kind->options->reports != NULL &&
         kind->options->reports[aggregate->operand] == FM_UNREPORTED &&
         monitor->requirements[aggregate->operand].group < monitor->n_groups &&
         type == (aggregate->operation == FM_COUNT_OF ? FM_INT64 : FM_BOOL);
}

static bool options_are_sound(const struct fm_scopes_options * options)
{
  const struct fm_monitor * monitor = options->bundle->monitor;
  bool are_sound = monitor != NULL && monitor->abi == FM_ABI;
  for (uint32_t k = 0; k < options->n_kinds; ++k) {
    are_sound = are_sound && kind_is_sound(options, &options->kinds[k]) &&
      order_is_sound(options, k) && base_is_sound(options, k) &&
      pairs_are_sound(options, &options->kinds[k]);
  }
  for (uint32_t a = 0; a < options->n_aggregates; ++a) {
    are_sound = are_sound && aggregate_is_sound(options, &options->aggregates[a]);
  }
  return are_sound;
}

uint64_t fm_scopes_bytes(const struct fm_scopes_options * options)
{
  if (!options_are_sound(options)) {
    return 0;
  }
  const struct layout layout = lay_out(options);
  return layout.block.fits ? layout.block.bytes : 0;
}

// ---- making them -------------------------------------------------------------------------------

static void list_topic_inputs(
  struct fm_topic * topics, const struct fm_scopes_options * options, uint32_t * inputs)
{
  for (uint32_t t = 0; t < options->bundle->n_topics; ++t) {
    const struct fm_topic * plain = &options->bundle->topics[t];
    uint32_t n = plain->n_inputs;
    if (n > 0) {
      memcpy(inputs, plain->inputs, n * sizeof(*inputs));
    }
    for (uint32_t a = 0; a < options->n_aggregates; ++a) {
      if (feeds(options, t, &options->aggregates[a])) {
        inputs[n] = options->aggregates[a].input;
        n += 1;
      }
    }
    topics[t].inputs = inputs;
    topics[t].n_inputs = n;
    inputs += n;
  }
}

static void map_copies(struct fm_scope_kind * kind, uint32_t * copies, uint32_t n_inputs)
{
  kind->copies = copies;
  for (uint32_t b = 0; b < n_inputs; ++b) {
    copies[b] = UINT32_MAX;
  }
  for (uint32_t i = 0; i < kind->pool.evaluator->monitor->n_inputs; ++i) {
    if (kind->options.shared[i] != UINT32_MAX) {
      copies[kind->options.shared[i]] = i;
    }
  }
}

// The inputs of the base that are of this kind, too.
static void map_parts(struct fm_scope_kind * kind, uint32_t * parts, uint32_t n_inputs)
{
  kind->parts = parts;
  for (uint32_t b = 0; b < n_inputs; ++b) {
    parts[b] = UINT32_MAX;
  }
  for (uint32_t i = 0; i < kind->pool.evaluator->monitor->n_inputs; ++i) {
    if (kind->options.shared[i] == UINT32_MAX) {
      parts[kind->options.of_base[i]] = i;
    }
  }
}

static void begin_as_base(struct fm_pool * pool)
{
  for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
    if (fm_keys_has(pool->keys, slot)) {
      fm_pool_begin(pool, slot);
    }
  }
}

static bool begin_listed(struct fm_scope_kind * kind)
{
  for (uint32_t n = 0; n < kind->options.n_listed; ++n) {
    const struct fm_key * key = &kind->options.listed[n];
    if (key->size == 0 ||
      fm_keys_find(kind->pool.keys, key->bytes, key->size) != FM_NO_SLOT)
    {
      return false;
    }
    const uint32_t slot = fm_keys_add(kind->pool.keys, key->bytes, key->size);
    if (slot == FM_NO_SLOT || (kind->pairs != NULL && !(fm_pairs_fit(kind->pairs, key) &&
      fm_pairs_add(kind->pairs, slot, key))))
    {
      return false;
    }
    fm_pool_begin(&kind->pool, slot);
  }
  return true;
}

static bool make_pool(
  struct fm_scopes * scopes, const struct fm_scopes_options * options, struct fm_scope_kind * kind,
  char * bytes)
{
  static const uint64_t NO_SEED[2] = {0, 0};
  const bool has_base = kind->options.of_base != NULL;
  const struct fm_pool_options made = {
    kind->options.options, has_base ? scopes->kinds[kind->options.base].pool.keys : NULL,
    options->seed == NULL ? NO_SEED : options->seed, kind->options.most,
    has_base ? 0 : kind->options.forget};
  return fm_pool_make(&kind->pool, bytes, &made);
}

static bool make_pairs(
  struct fm_scopes * scopes, const struct fm_scopes_options * options, struct fm_scope_kind * kind,
  char * bytes)
{
  static const uint64_t NO_SEED[2] = {0, 0};
  if (kind->options.halves == NULL) {
    return true;
  }
  for (uint32_t h = 0; h < 2; ++h) {
    const uint32_t half = kind->options.halves[h].kind;
    if (half != FM_BUNDLE) {
      scopes->kinds[half].keeps_parts = true;
    }
  }
  kind->pairs = kind->options.of_base != NULL ? &scopes->kinds[kind->options.base].own_pairs :
    &kind->own_pairs;
  return kind->options.of_base != NULL || fm_pairs_make(
    kind->pairs, bytes, kind->options.halves, kind->options.most,
    options->seed == NULL ? NO_SEED : options->seed);
}

static bool make_kinds(
  struct fm_scopes * scopes, const struct fm_scopes_options * options, char * bytes,
  const struct layout * layout)
{
  char * const all = (char *)(void *)scopes;
  uint32_t * maps = (uint32_t *)(void *)(all + layout->maps);
  uint32_t * waiting = (uint32_t *)(void *)(all + layout->waiting);
  const uint32_t n_inputs = options->bundle->monitor->n_inputs;
  for (uint32_t k = 0; k < options->n_kinds; ++k) {
    struct fm_scope_kind * kind = &scopes->kinds[k];
    kind->options = options->kinds[k];
    if (!make_pool(scopes, options, kind, bytes)) {
      return false;
    }
    bytes += pool_bytes(&kind->options);
    if (!make_pairs(scopes, options, kind, bytes)) {
      return false;
    }
    bytes += pairs_bytes(&kind->options);
    map_copies(
      kind, (uint32_t *)(void *)(all + layout->copies) + (uint64_t)k * n_inputs, n_inputs);
    kind->reads_aggregates = reads_aggregates(&kind->options);
    kind->waiting = waiting_of(&kind->options) > 0 ? waiting : NULL;
    waiting += waiting_of(&kind->options);
    if (kind->options.of_base != NULL) {
      scopes->kinds[kind->options.base].keeps_parts = true;
      map_parts(kind, maps, inputs_of_base(options, &kind->options));
      maps += inputs_of_base(options, &kind->options);
      begin_as_base(&kind->pool);
    } else if (!begin_listed(kind)) {
      return false;
    }
  }
  for (uint32_t a = 0; a < options->n_aggregates; ++a) {
    const struct fm_aggregate * aggregate = &options->aggregates[a];
    scopes->totals[a] = fm_total_make(
      aggregate, output_of(options, aggregate), group_of(options, aggregate),
      options->kinds[aggregate->kind].most, bytes);
    bytes += bytes_of_aggregate(options, aggregate);
  }
  return true;
}

static void place_parts(
  struct fm_scopes * scopes, const struct fm_scopes_options * options, char * bytes,
  const struct layout * layout)
{
  scopes->kinds = (struct fm_scope_kind *)(void *)(bytes + layout->kinds);
  scopes->totals = (struct fm_total *)(void *)(bytes + layout->totals);
  scopes->steps = (uint64_t *)(void *)(bytes + layout->steps);
  scopes->topics = (struct fm_topic *)(void *)(bytes + layout->topics);
  scopes->staged = (struct fm_staged *)(void *)(bytes + layout->staged);
  scopes->parts = (struct fm_staged *)(void *)(bytes + layout->parts);
  scopes->found = (struct fm_violation *)(void *)(bytes + layout->found);
  scopes->stepped = (struct fm_stepped *)(void *)(bytes + layout->stepped);
  scopes->sink = options->sink;
  scopes->context = options->context;
  scopes->n_kinds = options->n_kinds;
  scopes->n_totals = options->n_aggregates;
  scopes->most_stepped = options->most_stepped;
  scopes->message.kind = FM_BUNDLE;
}

void fm_scopes_initial(
  struct fm_scopes * scopes, uint32_t kind, uint32_t input, union fm_value value)
{
  if (kind >= scopes->n_kinds) {
    return;
  }
  struct fm_pool * pool = &scopes->kinds[kind].pool;
  fm_pool_leave(pool);
  fm_evaluator_initial(pool->evaluator, input, value);
  for (uint32_t slot = 0; slot < pool->keys->end; ++slot) {
    if (fm_keys_has(pool->keys, slot)) {
      fm_evaluator_initial(fm_scopes_enter_slot(scopes, kind, slot), input, value);
      fm_pool_leave(pool);
    }
  }
}

static void store_initial_aggregates(struct fm_scopes * scopes)
{
  for (uint32_t a = 0; a < scopes->n_totals; ++a) {
    struct fm_total * total = &scopes->totals[a];
    total->has_last = fm_total_value(total, &total->last);
    if (!total->has_last) {
      continue;
    }
    fm_evaluator_initial(scopes->bundle, total->options.input, total->last);
    for (uint32_t k = 0; k < scopes->n_kinds; ++k) {
      fm_scopes_initial(
        scopes, k, scopes->kinds[k].copies[total->options.input], total->last);
    }
  }
}

struct fm_scopes * fm_scopes_init(void * memory, const struct fm_scopes_options * options)
{
  if (fm_scopes_bytes(options) == 0) {
    return NULL;
  }
  const struct layout layout = lay_out(options);
  char * const bytes = memory;
  struct fm_scopes * scopes = memory;
  place_parts(scopes, options, bytes, &layout);
  list_topic_inputs(
    scopes->topics, options, (uint32_t *)(void *)(bytes + layout.topic_inputs));
  scopes->options = *options->bundle;
  scopes->options.topics = scopes->topics;
  scopes->bundle = fm_evaluator_init(bytes + layout.bundle, &scopes->options);
  if (scopes->bundle == NULL ||
    !make_kinds(scopes, options, bytes + layout.pools, &layout))
  {
    return NULL;
  }
  store_initial_aggregates(scopes);
  return scopes;
}
