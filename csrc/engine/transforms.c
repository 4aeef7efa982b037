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

/// transforms.c: links as they come, and chains of them; see tf2's BufferCore and TimeCache.

#include "transforms.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fret_cdr.h"

#define NO_FRAME UINT32_MAX
#define FIRST_SAMPLES 64u
#define MOST_OFF_UNIT 10e-3  // of the square of a quaternion's norm, as tf2

struct sample
{
  int64_t stamp;
  uint32_t parent;
  struct fm_pose pose;
};

// A chain of links from a frame up to another, `at`.
struct chain
{
  struct fm_pose below;  // the pose of the first frame in the last
  int64_t common;        // the least stamp of its moving links; INT64_MAX: none
  int64_t oldest;        // the same of the static ones
  uint32_t at;
};

// A frame and its link: samples[first], ..., samples[end - 1], by ascending stamps.
struct frame
{
  char name[FM_MOST_FRAME_BYTES + 1u];
  struct sample * samples;
  uint32_t first;
  uint32_t end;
  uint32_t room;
  bool is_static;
  uint64_t seen;        // the walk that passed last
  struct chain passed;  // what it was then
};

struct fm_tree
{
  struct frame * frames;
  uint32_t n;
  uint32_t room;
  uint64_t walks;
  struct fm_tree_counts counts;
  char missing[2][FM_MOST_FRAME_BYTES + 1u];
};

// ---- poses -------------------------------------------------------------------------------------

static const struct fm_pose IDENTITY = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};

static void multiply(const double a[4], const double b[4], double out[4])
{
  const double product[4] = {
    a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
    a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
    a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
    a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
  memcpy(out, product, sizeof(product));
}

static void rotate(const double q[4], const double v[3], double out[3])
{
  const double pure[4] = {v[0], v[1], v[2], 0.0};
  const double conjugate[4] = {-q[0], -q[1], -q[2], q[3]};
  double turned[4];
  multiply(q, pure, turned);
  multiply(turned, conjugate, turned);
  memcpy(out, turned, 3u * sizeof(*out));
}

// The pose in a frame of what has the pose `inner` in a frame with the pose `outer`.
static struct fm_pose compose(const struct fm_pose * outer, const struct fm_pose * inner)
{
  struct fm_pose pose;
  rotate(outer->rotation, inner->translation, pose.translation);
  for (int k = 0; k < 3; ++k) {
    pose.translation[k] += outer->translation[k];
  }
  multiply(outer->rotation, inner->rotation, pose.rotation);
  return pose;
}

static struct fm_pose inverse(const struct fm_pose * pose)
{
  const double * const q = pose->rotation;
  const double * const t = pose->translation;
  const double back[3] = {-t[0], -t[1], -t[2]};
  struct fm_pose out = {{0.0, 0.0, 0.0}, {-q[0], -q[1], -q[2], q[3]}};
  rotate(out.rotation, back, out.translation);
  return out;
}

// Shoemake, "Animating rotation with quaternion curves", 1985; along the shorter arc.
static void slerp(const double a[4], const double b[4], double ratio, double out[4])
{
  const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const double angle = acos(fmin(1.0, fabs(dot)));
  const double sine = sin(angle);
  const double of_a = sine > 0.0 ? sin((1.0 - ratio) * angle) / sine : 1.0;
  const double of_b = sine > 0.0 ? copysign(sin(ratio * angle) / sine, dot) : 0.0;
  for (int k = 0; k < 4; ++k) {
    out[k] = of_a * a[k] + of_b * b[k];
  }
}

static struct fm_pose interpolate(const struct sample * a, const struct sample * b, int64_t time)
{
  const double ratio = (double)(time - a->stamp) / (double)(b->stamp - a->stamp);
  struct fm_pose pose;
  for (int k = 0; k < 3; ++k) {
    const double from = a->pose.translation[k];
    pose.translation[k] = from + ratio * (b->pose.translation[k] - from);
  }
  slerp(a->pose.rotation, b->pose.rotation, ratio, pose.rotation);
  return pose;
}

// ---- links -------------------------------------------------------------------------------------

static const struct sample * newest(const struct frame * frame)
{
  return frame->first == frame->end ? NULL : &frame->samples[frame->end - 1u];
}

// The index of the first sample that is later than a time.
static uint32_t first_after(const struct frame * frame, int64_t time)
{
  uint32_t low = frame->first;
  uint32_t high = frame->end;
  while (low < high) {
    const uint32_t middle = low + (high - low) / 2u;
    if (frame->samples[middle].stamp <= time) {
      low = middle + 1u;
    } else {
      high = middle;
    }
  }
  return low;
}

// The link at a time; INT64_MAX: the newest. Between samples with two parents the earlier holds.
// Returns false if there is no sample, or the time is before the first or after the last.
static bool link_at(const struct frame * frame, int64_t time, struct sample * out)
{
  const struct sample * const last = newest(frame);
  if (last == NULL) {
    return false;
  }
  if (frame->is_static || time == INT64_MAX || time == last->stamp) {
    *out = *last;
    return true;
  }
  const uint32_t after = first_after(frame, time);
  if (after == frame->first || after == frame->end) {
    return false;
  }
  const struct sample * const a = &frame->samples[after - 1u];
  *out = *a;
  if (a->stamp < time && a->parent == a[1].parent) {
    out->pose = interpolate(a, a + 1, time);
  }
  return true;
}

static bool has_room(struct frame * frame)
{
  if (frame->end < frame->room) {
    return true;
  }
  const uint32_t n = frame->end - frame->first;
  if (frame->first > frame->room / 2u || (n == FM_MOST_SAMPLES && frame->first > 0u)) {
    memmove(frame->samples, frame->samples + frame->first, n * sizeof(struct sample));
    frame->first = 0u;
    frame->end = n;
    return true;
  }
  const uint32_t room = frame->room == 0u ? FIRST_SAMPLES : frame->room * 2u;
  struct sample * const grown = realloc(frame->samples, room * sizeof(struct sample));
  if (grown != NULL) {
    frame->samples = grown;
    frame->room = room;
  }
  return grown != NULL;
}

static void insert(struct fm_tree * tree, struct frame * frame, const struct sample * sample)
{
  const struct sample * const last = newest(frame);
  if (last != NULL && sample->stamp < last->stamp - FM_TREE_NS) {
    tree->counts.old += 1;
    return;
  }
  const uint32_t before = first_after(frame, sample->stamp);
  if (before > frame->first && frame->samples[before - 1u].stamp == sample->stamp) {
    return;  // repeated
  }
  if (frame->end - frame->first == FM_MOST_SAMPLES) {
    frame->first += 1u;
  }
  const uint32_t behind = frame->end - (before > frame->first ? before : frame->first);
  if (!has_room(frame)) {
    return;
  }
  struct sample * const place = &frame->samples[frame->end - behind];
  memmove(place + 1, place, behind * sizeof(*place));
  *place = *sample;
  frame->end += 1u;
  const int64_t oldest = newest(frame)->stamp - FM_TREE_NS;
  while (frame->samples[frame->first].stamp < oldest) {
    frame->first += 1u;
  }
}

// ---- frames ------------------------------------------------------------------------------------

static uint32_t find(const struct fm_tree * tree, const char * name, size_t length)
{
  for (uint32_t f = 0; f < tree->n && length <= FM_MOST_FRAME_BYTES; ++f) {
    if (memcmp(tree->frames[f].name, name, length) == 0 && tree->frames[f].name[length] == '\0') {
      return f;
    }
  }
  return NO_FRAME;
}

static uint32_t find_or_add(struct fm_tree * tree, const char * name, size_t length)
{
  const uint32_t found = find(tree, name, length);
  if (found != NO_FRAME || tree->n == FM_MOST_FRAMES) {
    return found;
  }
  if (tree->n == tree->room) {
    const uint32_t room = tree->room == 0u ? FIRST_SAMPLES : tree->room * 2u;
    struct frame * const grown = realloc(tree->frames, room * sizeof(*grown));
    if (grown == NULL) {
      return NO_FRAME;
    }
    tree->frames = grown;
    tree->room = room;
  }
  struct frame * const frame = &tree->frames[tree->n];
  memset(frame, 0, sizeof(*frame));
  memcpy(frame->name, name, length);
  tree->n += 1u;
  return tree->n - 1u;
}

static bool closes_loop(const struct fm_tree * tree, uint32_t child, uint32_t parent)
{
  uint32_t f = parent;
  for (uint32_t k = 0; k < tree->n && f != child; ++k) {
    const struct sample * const link = newest(&tree->frames[f]);
    if (link == NULL) {
      return false;
    }
    f = link->parent;
  }
  return f == child;
}

// ---- messages ----------------------------------------------------------------------------------

struct link
{
  int64_t stamp;
  struct fm_cdr_text parent;
  struct fm_cdr_text child;
  struct fm_pose pose;
};

// tf2 ignores a slash at the begin of a name.
static struct fm_cdr_text name_of(struct fm_cdr * c)
{
  struct fm_cdr_text text = fm_cdr_string(c);
  if (text.length > 0u && text.bytes[0] == '/') {
    text.bytes += 1;
    text.length -= 1u;
  }
  return text;
}

static struct link read_link(struct fm_cdr * c)
{
  struct link link;
  const int32_t sec = fm_cdr_int32(c);
  link.stamp = fm_cdr_nanoseconds(sec, fm_cdr_uint32(c));
  link.parent = name_of(c);
  link.child = name_of(c);
  for (int k = 0; k < 3; ++k) {
    link.pose.translation[k] = fm_cdr_float64(c);
  }
  for (int k = 0; k < 4; ++k) {
    link.pose.rotation[k] = fm_cdr_float64(c);
  }
  return link;
}

static bool is_name(const struct fm_cdr_text * text)
{
  return text->length > 0u && text->length <= FM_MOST_FRAME_BYTES &&
         memchr(text->bytes, 0, text->length) == NULL;
}

static bool is_usable(const struct link * link)
{
  const double * const t = link->pose.translation;
  const double * const q = link->pose.rotation;
  const double norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return is_name(&link->parent) && is_name(&link->child) &&
         !fm_cdr_is(&link->child, (const char *)link->parent.bytes, link->parent.length) &&
         isfinite(t[0]) && isfinite(t[1]) && isfinite(t[2]) && fabs(norm - 1.0) < MOST_OFF_UNIT;
}

static void take(struct fm_tree * tree, const struct link * link, bool is_static)
{
  const uint32_t parent = !is_usable(link) ? NO_FRAME :
    find_or_add(tree, (const char *)link->parent.bytes, link->parent.length);
  const uint32_t child = parent == NO_FRAME ? NO_FRAME :
    find_or_add(tree, (const char *)link->child.bytes, link->child.length);
  if (child == NO_FRAME) {
    tree->counts.unusable += 1;
    return;
  }
  if (closes_loop(tree, child, parent)) {
    tree->counts.loops += 1;
    return;
  }
  struct frame * const frame = &tree->frames[child];
  const struct sample sample = {link->stamp, parent, link->pose};
  if (frame->first == frame->end) {
    frame->is_static = is_static;
  } else if (frame->is_static) {
    frame->end = frame->first;  // the last one holds, whatever its stamp
  }
  insert(tree, frame, &sample);
}

bool fm_tree_read(struct fm_tree * tree, const uint8_t * message, size_t size, bool is_static)
{
  struct fm_cdr c;
  if (!fm_cdr_open(&c, message, size)) {
    return false;
  }
  struct fm_cdr all = c;
  const uint32_t n = fm_cdr_uint32(&all);
  for (uint32_t k = 0; k < n && all.ok; ++k) {
    (void)read_link(&all);
  }
  if (all.ok) {
    (void)fm_cdr_uint32(&c);
    for (uint32_t k = 0; k < n; ++k) {
      const struct link link = read_link(&c);
      take(tree, &link, is_static);
    }
  }
  return all.ok;
}

void fm_tree_forget(struct fm_tree * tree)
{
  for (uint32_t f = 0; f < tree->n; ++f) {
    if (!tree->frames[f].is_static) {
      tree->frames[f].first = tree->frames[f].end = 0u;
    }
  }
}

// ---- chains ------------------------------------------------------------------------------------

// Move a chain to the parent at a time; false if its frame has no link then.
static bool climb(const struct fm_tree * tree, struct chain * chain, int64_t time)
{
  const struct frame * const frame = &tree->frames[chain->at];
  struct sample link;
  if (!link_at(frame, time, &link)) {
    return false;
  }
  int64_t * const least = frame->is_static ? &chain->oldest : &chain->common;
  *least = link.stamp < *least ? link.stamp : *least;
  chain->below = compose(&link.pose, &chain->below);
  chain->at = link.parent;
  return true;
}

static struct chain begin(uint32_t frame)
{
  const struct chain chain = {IDENTITY, INT64_MAX, INT64_MAX, frame};
  return chain;
}

// Climb from a frame to the root, and note what was passed. Returns the last frame. Links at one
// time may close a loop, though those of the newest samples do not.
static uint32_t mark(struct fm_tree * tree, uint32_t from, int64_t time)
{
  struct chain chain = begin(from);
  tree->walks += 1u;
  do {
    struct frame * const frame = &tree->frames[chain.at];
    frame->seen = tree->walks;
    frame->passed = chain;
  } while (climb(tree, &chain, time) && tree->frames[chain.at].seen != tree->walks);
  return chain.at;
}

static bool is_marked(const struct fm_tree * tree, uint32_t frame)
{
  return tree->frames[frame].seen == tree->walks;
}

static void copy_name(char out[FM_MOST_FRAME_BYTES + 1u], const char * name)
{
  const size_t length = strlen(name);
  const size_t taken = length < FM_MOST_FRAME_BYTES ? length : FM_MOST_FRAME_BYTES;
  memmove(out, name, taken);
  out[taken] = '\0';
}

static void note_missing(struct fm_tree * tree, const char * of_from, const char * of_to)
{
  copy_name(tree->missing[0], of_from);
  copy_name(tree->missing[1], of_to);
}

// The chains of two frames end in two: a link is missing there, or has no sample at the time.
static void blame(struct fm_tree * tree, uint32_t of_from, uint32_t of_to)
{
  const struct frame * const a = &tree->frames[of_from];
  const struct frame * const b = &tree->frames[of_to];
  note_missing(
    tree, newest(a) == NULL && newest(b) != NULL ? b->name : a->name,
    newest(a) != NULL ? a->name : b->name);
}

static bool connect(
  struct fm_tree * tree, uint32_t from, uint32_t to, int64_t time, struct chain * out)
{
  const uint32_t root = mark(tree, from, time);
  *out = begin(to);
  for (uint32_t k = 0; k < tree->n && !is_marked(tree, out->at); ++k) {
    if (!climb(tree, out, time)) {
      break;
    }
  }
  if (!is_marked(tree, out->at)) {
    blame(tree, root, out->at);
    return false;
  }
  const struct chain * const met = &tree->frames[out->at].passed;
  const struct fm_pose back = inverse(&met->below);
  out->below = compose(&back, &out->below);
  out->common = met->common < out->common ? met->common : out->common;
  out->oldest = met->oldest < out->oldest ? met->oldest : out->oldest;
  return true;
}

static bool are_known(
  struct fm_tree * tree, const char * from, const char * to, uint32_t * first, uint32_t * second)
{
  *first = find(tree, from, strlen(from));
  *second = find(tree, to, strlen(to));
  if (*first != NO_FRAME && *second != NO_FRAME) {
    return true;
  }
  note_missing(
    tree, *first == NO_FRAME ? from : tree->frames[mark(tree, *first, INT64_MAX)].name,
    *second == NO_FRAME ? to : tree->frames[mark(tree, *second, INT64_MAX)].name);
  return false;
}

bool fm_tree_look_up(
  struct fm_tree * tree, const char * from, const char * to, struct fm_looked_up * out)
{
  uint32_t first;
  uint32_t second;
  struct chain chain;
  if (!are_known(tree, from, to, &first, &second) ||
    !connect(tree, first, second, INT64_MAX, &chain))
  {
    return false;
  }
  const int64_t common = chain.common;
  if (common != INT64_MAX && !connect(tree, first, second, common, &chain)) {
    return false;
  }
  out->pose = chain.below;
  out->stamp = common != INT64_MAX ? common : chain.oldest != INT64_MAX ? chain.oldest : 0;
  return true;
}

const char * fm_tree_missing(const struct fm_tree * tree, bool of_to)
{
  return tree->missing[of_to ? 1 : 0];
}

struct fm_tree_counts fm_tree_left_out(const struct fm_tree * tree) {return tree->counts;}

struct fm_tree * fm_tree_create(void) {return calloc(1, sizeof(struct fm_tree));}

void fm_tree_destroy(struct fm_tree * tree)
{
  for (uint32_t f = 0; tree != NULL && f < tree->n; ++f) {
    free(tree->frames[f].samples);
  }
  if (tree != NULL) {
    free(tree->frames);
  }
  free(tree);
}
