-- Copyright 2026 The fret_monitor authors
--
-- Licensed under the Apache License, Version 2.0 (the "License");
-- you may not use this file except in compliance with the License.
-- You may obtain a copy of the License at
--
--     http://www.apache.org/licenses/LICENSE-2.0
--
-- Unless required by applicable law or agreed to in writing, software
-- distributed under the License is distributed on an "AS IS" BASIS,
-- WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
-- See the License for the specific language governing permissions and
-- limitations under the License.

-- | The works of bench/run.py as an expert in Copilot writes them: with counters in place of the
-- operators of its libraries. @counters WORK PREFIX@ writes PREFIX.c here.
module Main (main) where

import Copilot.Compile.C99 (compile)
import Language.Copilot
import qualified Prelude as P
import System.Environment (getArgs)

main :: P.IO ()
main = do
  [work, prefix] <- getArgs
  reify (properties (works work)) P.>>= compile prefix

-- | A handler for each formula, called where it is false.
properties :: [Stream Bool] -> Spec
properties formulas = P.sequence_ [handle i f | (i, f) <- P.zip [0 :: P.Int ..] formulas]
  where handle i f = trigger ("handlerpropR" P.++ P.show i) (not f) []

works :: P.String -> [Stream Bool]
works "running_example" = [running 0]
works "copies" = P.map running [0 .. 99]
works "historically" = [lasting (not p) == 0]
works "once" = [lasting p > 0]
works "since" = [sinceWithin > 0]
works "since_ever" = [sinceEver]
works other = P.error ("no work " P.++ other)

p, q :: Stream Bool
p = extern "p" Nothing
q = extern "q" Nothing

-- | One less, down to 0.
fading :: (Typed a, P.Num a, P.Eq a, P.Ord a) => Stream a -> Stream a
fading n = mux (n > 0) (n - 1) 0

-- | For how many steps, this one included, something of the last 1001 steps still counts.
lasting :: Stream Bool -> Stream Word16
lasting event = left
  where left = mux event 1001 (fading ([0] ++ left))

sinceWithin :: Stream Word16
sinceWithin = left
  where left = mux q 1001 (mux p (fading ([0] ++ left)) 0)

sinceEver :: Stream Bool
sinceEver = held
  where held = q || (p && ([False] ++ held))

-- | H (O[10,10] (rising edge of persisted(10, overload) & !r) -> O[0,9] (FTP | r))
running :: P.Int -> Stream Bool
running i = held
  where
    response = current i <= 15.0
    overload = (current i > 15.0) && (wind i > 8.0)
    run = mux overload (mux (before < 11) (before + 1) 11) 0
    before = [0] ++ run :: Stream Word8
    missed = run == 11 && before /= 11 && not response
    due = P.replicate 10 False ++ missed
    left = mux response 10 (fading ([11] ++ left)) :: Stream Word8
    held = ([True] ++ held) && (not due || left > 0)

current, wind :: P.Int -> Stream Float
current i = extern ("current_" P.++ P.show i P.++ "x") Nothing
wind i = extern ("wind_" P.++ P.show i P.++ "x") Nothing
