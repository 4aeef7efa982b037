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

-- | The works of bench/run.py as Ogma prints them for Copilot: formula by formula, with the
-- operators of Copilot's libraries PTLTL and MTL. @ogma WORK PREFIX@ writes PREFIX.c here.
--
-- A term that a formula holds twice is written twice, as functions do here: nothing is shared.
-- Ogma's own reader knows no @S@ with bounds; @since@ is the operator that MTL has for it.
module Main (main) where

import Copilot.Compile.C99 (compile)
import qualified Copilot.Library.MTL as MTL
import qualified Copilot.Library.PTLTL as PTLTL
import Language.Copilot hiding (since)
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
works "historically" = [MTL.alwaysBeen 0 1000 clock 1 p]
works "once" = [MTL.eventuallyPrev 0 1000 clock 1 p]
works "since" = [MTL.since 0 1000 clock 1 p q]
works "since_ever" = [PTLTL.since p q]
works other = P.error ("no work " P.++ other)

p, q, ftp :: Stream Bool
p = extern "p" Nothing
q = extern "q" Nothing
ftp = [True] ++ false

clock :: Stream Int64
clock = [0] ++ (clock + 1)

-- | H (O[10,10] ((c & Y !c | c & FTP) & !r) -> O[0,9] (FTP | r))
running :: P.Int -> Stream Bool
running i = PTLTL.alwaysBeen (MTL.eventuallyPrev 10 10 clock 1 triggered ==> answered)
  where
    triggered = ((condition i && PTLTL.previous (not (condition i))) || (condition i && ftp))
                && not (response i)
    answered = MTL.eventuallyPrev 0 9 clock 1 (ftp || response i)

-- | H[0,10] overload & H[0,9] !FTP
condition :: P.Int -> Stream Bool
condition i = MTL.alwaysBeen 0 10 clock 1 (overload i) && MTL.alwaysBeen 0 9 clock 1 (not ftp)

overload, response :: P.Int -> Stream Bool
overload i = (current i > 15.0) && (wind i > 8.0)
response i = current i <= 15.0

current, wind :: P.Int -> Stream Float
current i = extern ("current_" P.++ P.show i P.++ "x") Nothing
wind i = extern ("wind_" P.++ P.show i P.++ "x") Nothing
