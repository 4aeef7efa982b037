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

// Stub: what a component uses of F Prime (3.4 to 4): types, time, commands. Events, telemetry and
// responses are printed. The base class of a component is made from its model by test_fprime.py.

#ifndef FW_HPP_
#define FW_HPP_

#include <cassert>
#include <cstdint>
#include <iostream>
#include <string>

using I8 = int8_t;
using I16 = int16_t;
using I32 = int32_t;
using I64 = int64_t;
using U8 = uint8_t;
using U16 = uint16_t;
using U32 = uint32_t;
using U64 = uint64_t;
using F32 = float;
using F64 = double;
using FwIndexType = int16_t;
using FwOpcodeType = U32;

#define FW_ASSERT(condition) assert(condition)

extern I64 nowInMicroseconds;

namespace Fw
{

class Time
{
public:
  U32 getSeconds() const {return static_cast<U32>(nowInMicroseconds / 1000000);}
  U32 getUSeconds() const {return static_cast<U32>(nowInMicroseconds % 1000000);}
};

struct CmdResponse
{
  enum T {OK = 0};
};

class PassiveComponentBase
{
public:
  explicit PassiveComponentBase(const char * name) {(void)name;}
  virtual ~PassiveComponentBase() {}

  // Call a port by its name, with arguments from standard input.
  virtual void call(const std::string & port) = 0;

protected:
  Time getTime() {return Time();}
  void cmdResponse_out(FwOpcodeType opCode, U32 cmdSeq, CmdResponse::T response)
  {
    std::cout << "response " << opCode << ' ' << cmdSeq << ' ' << response << '\n';
  }
  template<class T>
  T read()
  {
    T value;
    std::cin >> value;
    return value;
  }
};

// A byte is not read as a character.
template<>
inline I8 PassiveComponentBase::read<I8>() {return static_cast<I8>(read<int>());}
template<>
inline U8 PassiveComponentBase::read<U8>() {return static_cast<U8>(read<int>());}

}  // namespace Fw

#endif  // FW_HPP_
