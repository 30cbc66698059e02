"""The compiled loop over rows of `tdac_envs.rows`, which several threads run at once.

Numbers are words of 64 bits. The `door` says who may work:

| word | content |
|---|---|
| `OPEN` | number of the call that is being made; 0 when none is |
| `INSIDE` | helpers that are at work |
| `FAILED` | not 0 where a helper's call failed |
| `TAKEN + OWN * k` | the next place in the order that thread k has not taken |
| `AWAKE + OWN * k` | not 0 while helper k is awake, or has been woken |

Words that one thread writes and others read lie `APART` words from each other, so that
they share no line of the cache. The `plan` says what is done; see the constants. A
thread first takes the places of its own part of the order, so that rows stay in the
cache of one core from call to call, and then what the others have left.

A helper sleeps until something is written to its pipe. It may be woken some time before
a call; it then looks for it so many times, and sleeps again. It ends when `END` is the
last that was written, or when nobody can write any more.
"""

from __future__ import annotations

import ctypes
import functools
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

from tdac_envs.machine_code import kept, link, optimised

# Words of the door; thread 0 is the caller's.
APART = 16
OPEN, INSIDE, FAILED, TAKEN, AWAKE = (APART * k for k in range(5))
OWN = 2 * APART
# Words of the plan that stay: places taken at a time; number of each row's kernel; the
# kernels; words that are the row's own, how many, and those of each row; the words of
# a row as they are in the first, and their bytes; for each kernel the pieces copied
# before its calls and how many; pieces copied after them; ends of the helpers' pipes.
SHARE, KINDS, ENTRIES, COLUMNS, WIDTH, VALUES, BASE, BYTES = range(8)
GIVEN, RETURNED, BELLS = range(8, 11)
# Words of a call: rows in their order, how many; threads; pieces copied after a row's
# call; where what they are copied to begins.
ORDER, COUNT, THREADS, N_RETURNED, BLOCK, N_PLAN = range(11, 17)
# Words of a piece: address and bytes from row to row, to and from; bytes of a row, or
# what a number of 64 bits becomes.
N_PIECE = 5
TO_WHOLE, TO_FLAG = -1, -2
# How often a helper that was woken looks for its call, or tries to read from a pipe.
LOOKS = 1000
END = b"!"

_CODE = f"""
@ring = internal constant i8 0

declare i32 @sched_yield()
declare ptr @memcpy(ptr, ptr, i64)
declare i64 @read(i32, ptr, i64)
declare i64 @write(i32, ptr, i64)

define internal i64 @word(ptr %words, i64 %which) {{
  %at = getelementptr i64, ptr %words, i64 %which
  %value = load i64, ptr %at
  ret i64 %value
}}

define internal ptr @address(ptr %words, i64 %which) {{
  %value = call i64 @word(ptr %words, i64 %which)
  %address = inttoptr i64 %value to ptr
  ret ptr %address
}}

define internal ptr @at_row(ptr %piece, i64 %which, i64 %row) {{
  %base = call ptr @address(ptr %piece, i64 %which)
  %next = add i64 %which, 1
  %step = call i64 @word(ptr %piece, i64 %next)
  %offset = mul i64 %step, %row
  %at = getelementptr i8, ptr %base, i64 %offset
  ret ptr %at
}}

define internal void @copy(ptr %pieces, i64 %count, i64 %row, i64 %block) {{
start:
  br label %next
next:
  %number = phi i64 [0, %start], [%after, %done]
  %more = icmp slt i64 %number, %count
  br i1 %more, label %each, label %end
each:
  %piece = getelementptr [{N_PIECE} x i64], ptr %pieces, i64 %number
  %place = call ptr @at_row(ptr %piece, i64 0, i64 %row)
  %to = getelementptr i8, ptr %place, i64 %block
  %from = call ptr @at_row(ptr %piece, i64 2, i64 %row)
  %length = call i64 @word(ptr %piece, i64 4)
  switch i64 %length, label %bytes [
    i64 {TO_WHOLE}, label %whole
    i64 {TO_FLAG}, label %flag
  ]
bytes:
  call ptr @memcpy(ptr %to, ptr %from, i64 %length)
  br label %done
whole:
  %number_from = load double, ptr %from
  %as_whole = fptosi double %number_from to i64
  store i64 %as_whole, ptr %to
  br label %done
flag:
  %flag_from = load double, ptr %from
  %is_set = fcmp une double %flag_from, 0.0
  %as_byte = zext i1 %is_set to i8
  store i8 %as_byte, ptr %to
  br label %done
done:
  %after = add i64 %number, 1
  br label %next
end:
  ret void
}}

define internal void @fill(ptr %plan, ptr %slots, i64 %row) {{
start:
  %columns = call ptr @address(ptr %plan, i64 {COLUMNS})
  %width = call i64 @word(ptr %plan, i64 {WIDTH})
  %values = call ptr @address(ptr %plan, i64 {VALUES})
  %first = mul i64 %row, %width
  %own = getelementptr i64, ptr %values, i64 %first
  br label %next
next:
  %number = phi i64 [0, %start], [%after, %each]
  %more = icmp slt i64 %number, %width
  br i1 %more, label %each, label %end
each:
  %column = call i64 @word(ptr %columns, i64 %number)
  %value = call i64 @word(ptr %own, i64 %number)
  %slot = getelementptr i64, ptr %slots, i64 %column
  store i64 %value, ptr %slot
  %after = add i64 %number, 1
  br label %next
end:
  ret void
}}

define internal i32 @make(ptr %plan, ptr %slots, i64 %place) {{
  %order = call ptr @address(ptr %plan, i64 {ORDER})
  %row = call i64 @word(ptr %order, i64 %place)
  call void @fill(ptr %plan, ptr %slots, i64 %row)
  %kinds = call ptr @address(ptr %plan, i64 {KINDS})
  %kind_at = getelementptr i8, ptr %kinds, i64 %row
  %kind = load i8, ptr %kind_at
  %which = zext i8 %kind to i64
  %all_given = call ptr @address(ptr %plan, i64 {GIVEN})
  %own_given = getelementptr [2 x i64], ptr %all_given, i64 %which
  %given = call ptr @address(ptr %own_given, i64 0)
  %n_given = call i64 @word(ptr %own_given, i64 1)
  call void @copy(ptr %given, i64 %n_given, i64 %row, i64 0)
  %entries = call ptr @address(ptr %plan, i64 {ENTRIES})
  %entry = call ptr @address(ptr %entries, i64 %which)
  %status = call i32 %entry(ptr %slots)
  %returned = call ptr @address(ptr %plan, i64 {RETURNED})
  %n_returned = call i64 @word(ptr %plan, i64 {N_RETURNED})
  %block = call i64 @word(ptr %plan, i64 {BLOCK})
  call void @copy(ptr %returned, i64 %n_returned, i64 %row, i64 %block)
  ret i32 %status
}}

define internal i32 @share(ptr %plan, ptr %slots, i64 %begin, i64 %end) {{
start:
  br label %next
next:
  %place = phi i64 [%begin, %start], [%after, %each]
  %failed = phi i32 [0, %start], [%either, %each]
  %more = icmp slt i64 %place, %end
  br i1 %more, label %each, label %end_
each:
  %status = call i32 @make(ptr %plan, ptr %slots, i64 %place)
  %either = or i32 %failed, %status
  %after = add i64 %place, 1
  br label %next
end_:
  ret i32 %failed
}}

define internal i64 @begin(i64 %whose, i64 %count, i64 %threads) {{
  %several = mul i64 %whose, %count
  %first = udiv i64 %several, %threads
  ret i64 %first
}}

define internal i32 @part(ptr %door, ptr %plan, ptr %slots, i64 %whose) {{
start:
  %taken = call ptr @own(ptr %door, i64 {TAKEN}, i64 %whose)
  %threads = call i64 @word(ptr %plan, i64 {THREADS})
  %count = call i64 @word(ptr %plan, i64 {COUNT})
  %past = add i64 %whose, 1
  %last = call i64 @begin(i64 %past, i64 %count, i64 %threads)
  %size = call i64 @word(ptr %plan, i64 {SHARE})
  br label %next
next:
  %failed = phi i32 [0, %start], [%either, %each]
  %begin = atomicrmw add ptr %taken, i64 %size monotonic
  %more = icmp slt i64 %begin, %last
  br i1 %more, label %each, label %end
each:
  %full = add i64 %begin, %size
  %short = icmp slt i64 %last, %full
  %until = select i1 %short, i64 %last, i64 %full
  %status = call i32 @share(ptr %plan, ptr %slots, i64 %begin, i64 %until)
  %either = or i32 %failed, %status
  br label %next
end:
  ret i32 %failed
}}

define internal i32 @work(ptr %door, ptr %plan, ptr %slots, i64 %me) {{
start:
  %base = call ptr @address(ptr %plan, i64 {BASE})
  %bytes = call i64 @word(ptr %plan, i64 {BYTES})
  call ptr @memcpy(ptr %slots, ptr %base, i64 %bytes)
  %threads = call i64 @word(ptr %plan, i64 {THREADS})
  br label %next
next:
  %number = phi i64 [0, %start], [%after, %each]
  %failed = phi i32 [0, %start], [%either, %each]
  %more = icmp slt i64 %number, %threads
  br i1 %more, label %each, label %end
each:
  %sum = add i64 %me, %number
  %whose = urem i64 %sum, %threads
  %status = call i32 @part(ptr %door, ptr %plan, ptr %slots, i64 %whose)
  %either = or i32 %failed, %status
  %after = add i64 %number, 1
  br label %next
end:
  ret i32 %failed
}}

define internal ptr @own(ptr %door, i64 %which, i64 %whose) {{
  %far = mul i64 %whose, {OWN}
  %sum = add i64 %far, %which
  %at = getelementptr i64, ptr %door, i64 %sum
  ret ptr %at
}}

define void @tdac_wake(ptr %door, ptr %plan, i64 %threads) {{
start:
  %bells = call ptr @address(ptr %plan, i64 {BELLS})
  br label %next
next:
  %whose = phi i64 [1, %start], [%after, %done]
  %more = icmp slt i64 %whose, %threads
  br i1 %more, label %each, label %end
each:
  %awake_at = call ptr @own(ptr %door, i64 {AWAKE}, i64 %whose)
  %awake = atomicrmw xchg ptr %awake_at, i64 1 seq_cst
  %asleep = icmp eq i64 %awake, 0
  br i1 %asleep, label %ring, label %done
ring:
  %bell = call i64 @word(ptr %bells, i64 %whose)
  %end_of_pipe = trunc i64 %bell to i32
  %written = call i64 @write(i32 %end_of_pipe, ptr @ring, i64 1)
  br label %done
done:
  %after = add i64 %whose, 1
  br label %next
end:
  ret void
}}

define internal i32 @help(
    ptr %door, ptr %plan, ptr %slots, i64 %me, i64 %call
) {{
  %inside = getelementptr i64, ptr %door, i64 {INSIDE}
  %came = atomicrmw add ptr %inside, i64 1 seq_cst
  %now = load atomic i64, ptr %door seq_cst, align 8
  %open = icmp eq i64 %now, %call
  br i1 %open, label %enter, label %leave
enter:
  %status = call i32 @work(ptr %door, ptr %plan, ptr %slots, i64 %me)
  %told = zext i32 %status to i64
  %failed = getelementptr i64, ptr %door, i64 {FAILED}
  %before = atomicrmw or ptr %failed, i64 %told seq_cst
  br label %leave
leave:
  %went = atomicrmw sub ptr %inside, i64 1 seq_cst
  ret i32 0
}}

define void @tdac_help(ptr %door, ptr %plan, ptr %slots, i64 %me, i32 %pipe) {{
start:
  %heard = alloca [64 x i8]
  %awake = call ptr @own(ptr %door, i64 {AWAKE}, i64 %me)
  br label %rest
rest:
  %last = phi i64 [0, %start], [%last_seen, %tired], [%now, %helped]
  store atomic i64 0, ptr %awake seq_cst, align 8
  %missed = load atomic i64, ptr %door seq_cst, align 8
  %missed_none = icmp eq i64 %missed, 0
  %missed_old = icmp eq i64 %missed, %last
  %missed_no = or i1 %missed_none, %missed_old
  br i1 %missed_no, label %sleep, label %look
sleep:
  %failures = phi i64 [0, %rest], [%more_failures, %interrupted]
  %count = call i64 @read(i32 %pipe, ptr %heard, i64 64)
  %closed = icmp eq i64 %count, 0
  br i1 %closed, label %end, label %open
open:
  %failed = icmp slt i64 %count, 0
  br i1 %failed, label %interrupted, label %woken
interrupted:
  %more_failures = add i64 %failures, 1
  %for_good = icmp sgt i64 %more_failures, {LOOKS}
  br i1 %for_good, label %end, label %sleep
woken:
  %at = sub i64 %count, 1
  %last_at = getelementptr i8, ptr %heard, i64 %at
  %last_heard = load i8, ptr %last_at
  %ended = icmp eq i8 %last_heard, {ord(END)}
  br i1 %ended, label %end, label %look
look:
  %looks = phi i64 [0, %rest], [0, %woken], [%more_looks, %wait]
  %last_seen = phi i64 [%last, %rest], [%last, %woken], [%last_seen, %wait]
  %now = load atomic i64, ptr %door seq_cst, align 8
  %none = icmp eq i64 %now, 0
  %old = icmp eq i64 %now, %last_seen
  %no = or i1 %none, %old
  br i1 %no, label %wait, label %helped
wait:
  %more_looks = add i64 %looks, 1
  %ignored = call i32 @sched_yield()
  %patient = icmp slt i64 %more_looks, {LOOKS}
  br i1 %patient, label %look, label %tired
tired:
  br label %rest
helped:
  %status = call i32 @help(
    ptr %door, ptr %plan, ptr %slots, i64 %me, i64 %now
  )
  br label %rest
end:
  ret void
}}

define internal void @keep(ptr %plan, i64 %which, i64 %value) {{
  %at = getelementptr i64, ptr %plan, i64 %which
  store i64 %value, ptr %at
  ret void
}}

define i32 @tdac_rows(
    ptr %door, ptr %plan, ptr %slots, i64 %call,
    i64 %order, i64 %count, i64 %threads, i64 %returned, i64 %block
) {{
start:
  call void @keep(ptr %plan, i64 {ORDER}, i64 %order)
  call void @keep(ptr %plan, i64 {COUNT}, i64 %count)
  call void @keep(ptr %plan, i64 {THREADS}, i64 %threads)
  call void @keep(ptr %plan, i64 {N_RETURNED}, i64 %returned)
  call void @keep(ptr %plan, i64 {BLOCK}, i64 %block)
  call void @keep(ptr %door, i64 {FAILED}, i64 0)
  br label %next
next:
  %whose = phi i64 [0, %start], [%after, %each]
  %more = icmp slt i64 %whose, %threads
  br i1 %more, label %each, label %open
each:
  %first = call i64 @begin(i64 %whose, i64 %count, i64 %threads)
  %taken = call ptr @own(ptr %door, i64 {TAKEN}, i64 %whose)
  store i64 %first, ptr %taken
  %after = add i64 %whose, 1
  br label %next
open:
  store atomic i64 %call, ptr %door seq_cst, align 8
  call void @tdac_wake(ptr %door, ptr %plan, i64 %threads)
  %own = call i32 @work(ptr %door, ptr %plan, ptr %slots, i64 0)
  store atomic i64 0, ptr %door seq_cst, align 8
  %inside = getelementptr i64, ptr %door, i64 {INSIDE}
  br label %wait
wait:
  %busy = load atomic i64, ptr %inside seq_cst, align 8
  %alone = icmp eq i64 %busy, 0
  br i1 %alone, label %end, label %yield
yield:
  %ignored = call i32 @sched_yield()
  br label %wait
end:
  %failed = getelementptr i64, ptr %door, i64 {FAILED}
  %theirs = load atomic i64, ptr %failed seq_cst, align 8
  %told = trunc i64 %theirs to i32
  %either = or i32 %own, %told
  ret i32 %either
}}
"""


class RowLoop(NamedTuple):
    """Its entries, which take addresses of door and plan.

    Attributes:
        make: Makes a call: of the caller's slots, the call's number, which is not 0 and
            not that of the call before, and the plan's words of a call. Returns when
            all rows have been called, not 0 where one of them failed.
        help: Helps until it is over: of a helper's slots and number, and of its pipe.
        wake: Wakes the helpers among so many threads.
        code: Holds the machine code.
    """

    make: Callable[..., int]
    help: Callable[[int, int, int, int, int], None]
    wake: Callable[[int, int, int], None]
    code: Any


_LOCK = threading.Lock()


def row_loop() -> RowLoop:
    """The loop, from disk or compiled."""
    # Two engines would do, but none may be dropped while its code is used.
    with _LOCK:
        return _row_loop()


@functools.cache
def _row_loop() -> RowLoop:
    objects = kept("row_loop", [_CODE], lambda: [optimised(_CODE)])
    (engine, data), _ = link(objects, "tdac_rows")
    word, pointer = ctypes.c_int64, ctypes.c_void_p
    make = ctypes.CFUNCTYPE(ctypes.c_int32, *[pointer] * 3, *[word] * 6)
    help_ = ctypes.CFUNCTYPE(None, *[pointer] * 3, word, ctypes.c_int32)
    wake = ctypes.CFUNCTYPE(None, pointer, pointer, word)
    at = engine.get_function_address
    return RowLoop(
        make(at("tdac_rows")),
        help_(at("tdac_help")),
        wake(at("tdac_wake")),
        (engine, data),
    )
