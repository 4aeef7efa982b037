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
Names of variables, handlers and constants that an export shares with the user's program.

A name of a bundle is kept, so that a program finds it; FRET's names with points are spelled as
FRET spells them in formulas. What cannot be a name in C, or already is one, is refused.
"""

from collections.abc import Mapping
import re

from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen.names import C_KEYWORDS, CPP_KEYWORDS, is_of_module
from fret_monitor.export.content import export_name
from fret_monitor.model.diagnostics import Problems
from fret_monitor.model.names import fret_name

_IDENTIFIER = re.compile('[A-Za-z_][A-Za-z0-9_]*')
# What programs in C get from the C library, which no variable may replace (C99, 7.1.3).
_FUNCTIONS = frozenset("""
    main
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1
    fabs fdim floor fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10
    log1p log2 logb lrint lround modf nan nearbyint nextafter nexttoward pow remainder remquo rint
    round scalbln scalbn sin sinh sqrt tan tanh tgamma trunc
    fpclassify isfinite isgreater isinf isless isnan isnormal isunordered signbit
    memchr memcmp memcpy memmove memset strcat strchr strcmp strcoll strcpy strcspn strerror strlen
    strncat strncmp strncpy strpbrk strrchr strspn strstr strtok strxfrm
    abort abs atexit atof atoi atol atoll bsearch calloc div exit free getenv labs ldiv llabs lldiv
    malloc mblen mbstowcs mbtowc qsort rand realloc srand strtod strtof strtol strtold strtoll
    strtoul strtoull system wcstombs wctomb
    clearerr fclose feof ferror fflush fgetc fgetpos fgets fopen fprintf fputc fputs fread freopen
    fscanf fseek fsetpos ftell fwrite getc getchar gets perror printf putc putchar puts remove
    rename rewind scanf setbuf setvbuf snprintf sprintf sscanf tmpfile tmpnam ungetc vfprintf
    vfscanf vprintf vscanf vsnprintf vsprintf vsscanf
    asctime clock ctime difftime gmtime localtime mktime strftime time
    isalnum isalpha isblank iscntrl isdigit isgraph islower isprint ispunct isspace isupper
    isxdigit tolower toupper
    longjmp raise setjmp setlocale signal localeconv
""".split())
# What glibc's math.h, string.h, strings.h, stdio.h, stdlib.h and unistd.h declare besides, for
# compilers that are not asked for strict C99 (gnu17), or in C++.
_EXTENSIONS = frozenset("""
    a64l access acct alarm aligned_alloc alloca arc4random arc4random_buf arc4random_uniform
    at_quick_exit basename bcmp bcopy brk bzero canonicalize canonicalize_file_name chdir chown
    chroot clearenv clearerr_unlocked close closefrom confstr crypt ctermid daemon dprintf
    drand48 drand48_r drem dup dup2 ecvt ecvt_r endusershell environ erand48 erand48_r execl
    execle execlp execv execve execvp exp10 explicit_bzero faccessat fadd fchdir fchown fchownat
    fcvt fcvt_r fdatasync fdiv fdopen feof_unlocked ferror_unlocked fexecve fflush_unlocked ffma
    ffs ffsl ffsll fgetc_unlocked fileno fileno_unlocked finite flockfile fmaximum fmaximum_mag
    fmaximum_mag_num fmaximum_num fmaxmag fmemopen fminimum fminimum_mag fminimum_mag_num
    fminimum_num fminmag fmul fork fpathconf fputc_unlocked fread_unlocked fromfp fromfpx fseeko
    fsqrt fsub fsync ftello ftruncate ftrylockfile funlockfile fwrite_unlocked gamma gcvt
    getc_unlocked getchar_unlocked getcwd getdelim getdomainname getdtablesize getegid
    getentropy geteuid getgid getgroups gethostid gethostname getline getloadavg getlogin
    getlogin_r getopt getpagesize getpass getpayload getpgid getpgrp getpid getppid getpt getsid
    getsubopt getuid getusershell getw getwd grantpt index initstate initstate_r isatty
    iscanonical iseqsig isgreaterequal islessequal islessgreater issignaling iszero j0 j1 jn
    jrand48 jrand48_r l64a lchown lcong48 lcong48_r lgamma_r lgammaf_r lgammal_r link linkat
    llogb lockf lrand48 lrand48_r lseek memccpy memfrob memmem mempcpy memrchr mkdtemp mkostemp
    mkostemp64 mkostemps mkostemps64 mkstemp mkstemp64 mkstemps mkstemps64 mktemp mrand48
    mrand48_r nextdown nextup nice nrand48 nrand48_r on_exit open_memstream optarg opterr optind
    optopt pathconf pause pclose pipe popen posix_memalign posix_openpt pread profil pselect
    ptsname ptsname_r putc_unlocked putchar_unlocked putenv putw pwrite qecvt qecvt_r qfcvt
    qfcvt_r qgcvt qsort_r quick_exit rand_r random random_r rawmemchr read readlink readlinkat
    reallocarray realpath renameat revoke rindex rmdir roundeven rpmatch sbrk scalb
    secure_getenv seed48 seed48_r select setbuffer setdomainname setegid setenv seteuid setgid
    sethostid sethostname setlinebuf setlogin setpayload setpayloadsig setpgid setpgrp setregid
    setreuid setsid setstate setstate_r setuid setusershell sigabbrev_np sigdescr_np signgam
    significand sincos sleep srand48 srand48_r srandom srandom_r stpcpy stpncpy strcasecmp
    strcasecmp_l strcasestr strchrnul strcoll_l strdup strerror_l strerror_r strerrordesc_np
    strerrorname_np strfromd strfromf strfroml strfry strncasecmp strncasecmp_l strndup strnlen
    strsep strsignal strtod_l strtof_l strtok_r strtol_l strtold_l strtoll_l strtoq strtoul_l
    strtoull_l strtouq strverscmp strxfrm_l swab symlink symlinkat sync syscall sysconf
    tcgetpgrp tcsetpgrp tempnam tmpnam_r totalorder totalordermag truncate ttyname ttyname_r
    ttyslot u_char u_int u_long u_short ualarm ufromfp ufromfpx uint ulong unlink unlinkat
    unlockpt unsetenv ushort usleep valloc vdprintf vfork vhangup write y0 y1 yn
""".split())
_FLOATS = frozenset(f'{name}{kind}' for name in _FUNCTIONS for kind in 'fl')
# `acosf32x` is the function of _Float32x, `f32addf64` adds two numbers of _Float64.
_OTHER_FLOATS = re.compile(r'([a-z0-9_]+?)f(32|64|128)x?(_r)?')
_ARITHMETIC = re.compile(r'(d|f(32|64)x?)(add|sub|mul|div|fma|sqrt)(l|f(32|64|128)x?)'
                         r'|str(to|from)f(32|64|128)x?(_l)?')
_MACROS = re.compile(
    r'NULL|NAN|INFINITY|HUGE_VAL[FL]?|EOF|FILE|BUFSIZ|RAND_MAX|std(in|out|err)|errno'
    r'|assert|offsetof|linux|unix|DECIMAL_DIG'
    r'|math_errhandling|MATH_.*|FP_.*|(FLT|DBL|LDBL)_.*'
    r'|(U?INT|SIZE|PTRDIFF|WCHAR|WINT).*_(MAX|MIN|C)|FRET_MONITOR_.*')
_TYPES = re.compile(
    r'(u?int(_least|_fast)?(8|16|32|64)|u?intmax|u?intptr|size|ptrdiff|wchar|max_align|float'
    r'|double|l?l?div|fpos)_t|va_list')
_HEADERS = frozenset("""
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal
    stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string tgmath threads
    time uchar wchar wctype
""".split())


def check_name(name: str, problems: Problems) -> None:
    """Report a name of an export whose header would replace one of the C library."""
    if name in _HEADERS:
        problems.error(f"'{name}.h' is a header of the C library",
                       help=f'give the export another name, such as --name {name}_monitors')


def fault(word: str, name: str) -> str:
    """Return why a word cannot be an external name beside the C of the bundle `name`, or ''."""
    if _IDENTIFIER.fullmatch(word) is None:
        return 'has characters that names in C do not have'
    if word in C_KEYWORDS:
        return 'is a keyword of C'
    if word in _FUNCTIONS or word in _FLOATS:
        return 'is a function of the C library' if word != 'main' else 'is where a program begins'
    if _MACROS.fullmatch(word) or _TYPES.fullmatch(word):
        return 'is defined by a header of C'
    if word.startswith(('fm_', 'FM_', '__')) or re.match('_[A-Z]', word):
        return 'begins as names that are reserved'
    if word.endswith('_H_'):
        return 'ends as the names of include guards do'
    if is_of_module(word, name):
        return 'is a name of the generated C'
    return ''


def is_extension(word: str) -> bool:
    """Return whether glibc declares a word besides what C99 has."""
    of_other_float = _OTHER_FLOATS.fullmatch(word)
    return (word in _EXTENSIONS or word[-1:] in ('f', 'l') and word[:-1] in _EXTENSIONS
            or of_other_float is not None and of_other_float[1] in _FUNCTIONS | _EXTENSIONS
            or _ARITHMETIC.fullmatch(word) is not None)


def input_names(generated: GeneratedMonitor, defined: Mapping[str, str],
                problems: Problems) -> dict[str, str]:
    """
    Return the variable of each input.

    `defined` are the other external names, each with what it is. Names that cannot be used are
    reported with their places; a keyword of C++ alone, or an extension of glibc, is a warning.
    """
    name = export_name(generated)
    taken = dict(defined)
    names = {}
    for signal in generated.specification.signals:
        word = fret_name(signal.name)
        shown = f"'{signal.name}'" if word == signal.name else f"'{signal.name}' ({word} in C)"
        reason = fault(word, name) or (f'is {taken[word]}' if word in taken else '')
        if reason:
            problems.error(f'the input {shown} cannot be a variable: it {reason}', signal.place,
                           help=f'rename it, there and in formulas: {_other(word)}')
        elif word in CPP_KEYWORDS:
            problems.warning(f"'{word}' is a keyword of C++", signal.place,
                             'with this input the export can only be compiled as C')
        elif is_extension(word):
            problems.warning(
                f"'{word}' is declared by glibc's headers, except in strict C99", signal.place,
                'compilers that are not given -std=c99, and those of C++, may refuse the variable',
                f'rename it, there and in formulas: {_other(word)}')
        taken.setdefault(word, f"the variable of '{signal.name}'")
        names[signal.name] = word
    return names


def _other(word: str) -> str:
    plain = re.sub('[^A-Za-z0-9_]+', '_', word).strip('_') or 'input'
    return re.sub('^(fm_|FM_|_+)', '', plain) + '_value'


def constant_names(generated: GeneratedMonitor, prefix: str, inputs: Mapping[str, str],
                   defined: Mapping[str, str],
                   problems: Problems) -> dict[tuple[str, str], str]:
    """
    Return the constant `INPUT_VALUE` of each named value; report those that clash.

    `inputs` are the variables, and `defined` the other external names, each with what it is.
    """
    taken = {**defined, **{word: f"the variable of '{name}'" for name, word in inputs.items()}}
    names = {}
    for signal in generated.specification.signals:
        for value, _ in signal.values:
            word = f'{inputs[signal.name]}_{fret_name(value)}'
            word = f'{prefix}_{word}' if prefix else word
            reason = fault(word, export_name(generated)) or (
                f'is {taken[word]}' if word in taken else '')
            if reason:
                problems.error(f"the value '{value}' cannot be the constant {word}: it {reason}",
                               signal.place, help='rename the value or the input')
            taken[word] = f"the constant of '{signal.name}' for '{value}'"
            names[signal.name, value] = word
    return names
