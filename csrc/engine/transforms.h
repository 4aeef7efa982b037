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

/// transforms.h: the tree of coordinate frames that /tf and /tf_static describe.
///
/// A link is the transform from a frame to its parent. Of a moving link the samples of the last
/// FM_TREE_NS are kept, by their stamps; a static link has one, which holds at all times. A
/// transform is looked up as tf2 does with time 0: at the latest common time of the chain, the
/// least of the newest stamps of its moving links. Between two samples of a link the translation
/// is interpolated linearly, the rotation spherically; there is no extrapolation.
///
/// Not thread-safe. No function blocks; memory grows with the frames and samples.

#ifndef TRANSFORMS_H_
#define TRANSFORMS_H_

#include "fret_monitor.h"

#include <stddef.h>

#define FM_TREE_NS INT64_C(10000000000)  // as tf2's buffer
#define FM_MOST_FRAMES 1024u
#define FM_MOST_SAMPLES 8192u  // of a link
#define FM_MOST_FRAME_BYTES 255u

/// What was left out: links that would close a loop; those without a usable transform (no name,
/// the name of the parent, a number that is not finite, a quaternion that is not normalized), or
/// with a frame beyond FM_MOST_FRAMES; samples older than FM_TREE_NS before the newest.
struct fm_tree_counts
{
  uint64_t loops;
  uint64_t unusable;
  uint64_t old;
};

/// A rigid transform: translation x, y, z, and unit quaternion x, y, z, w.
struct fm_pose
{
  double translation[3];
  double rotation[4];
};

/// A transform that was looked up. `stamp` is the latest common time in nanoseconds; of a chain of
/// static links alone, the stamp of the oldest; 0 from a frame to itself.
struct fm_looked_up
{
  struct fm_pose pose;
  int64_t stamp;
};

struct fm_tree;

/// Make a tree without frames; NULL if memory is short. O(1).
FM_EXPORT struct fm_tree * fm_tree_create(void);

/// Free a tree; NULL is ignored. O(frames).
FM_EXPORT void fm_tree_destroy(struct fm_tree * tree);

/// Take the links of a serialized tf2_msgs/msg/TFMessage. Returns false, and takes none, if it
/// cannot be decoded. A frame stays static or moving as its first link was.
/// O(links * (frames + log samples)); O(samples) for a sample that is not the newest.
FM_EXPORT bool fm_tree_read(
  struct fm_tree * tree, const uint8_t * message, size_t size, bool is_static);

/// Forget the samples of all moving links, as tf2 does when the time goes back. O(frames).
FM_EXPORT void fm_tree_forget(struct fm_tree * tree);

/// Look up the transform that takes points in the frame `to` to the frame `from`: the pose of `to`
/// in `from`, as `tf2_echo from to` prints it. Returns false if there is none. O(frames + links of
/// the chain * log samples).
FM_EXPORT bool fm_tree_look_up(
  struct fm_tree * tree, const char * from, const char * to, struct fm_looked_up * out);

/// Where a chain is broken, after fm_tree_look_up has failed: the names of the two frames between
/// which a link is missing, the last of the chains of `from` and of `to`. If they are one name,
/// the samples of its link do not reach the latest common time. They are valid until the next
/// call. O(1).
FM_EXPORT const char * fm_tree_missing(const struct fm_tree * tree, bool of_to);

/// What was left out so far. O(1).
FM_EXPORT struct fm_tree_counts fm_tree_left_out(const struct fm_tree * tree);

#endif  // TRANSFORMS_H_
