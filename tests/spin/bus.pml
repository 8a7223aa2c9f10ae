/* The whole protocol of one bus, for spin: exchange, scheduler, start-up, background and faults, in ticks of about 10 us.
 *
 * What is here          and in core/include/tm485/bus
 *   since, distance     RequestSpacing: no request before T1 of the one before
 *   waiting, deadline   Exchange: a reply that is whole in time, or a named error
 *   hold_off            Bus::settle: a late reply must not answer the next request
 *   to_slot             Scheduler, phase kept: a missed slot is skipped
 *   stage               Startup, and Bus::cycle_failed that gives an encoder up
 *   agree               PlausibilityGate behind missing readings
 *   offered, waited     BackgroundQueue: an offer ends in a completion
 *   sample, age         fresh, held, invalid by max_hold
 *
 * The line may, FAULTS times: swallow a request or a reply, damage a reply, delay it beyond the deadline, or restart the
 * encoder. The owner may poll late, by JITTER ticks each time. Asserted on every way: T1 on the requests as they start; each
 * accepted reply answers its own request; no exchange waits longer than its deadline; nothing old is fresh; an offer
 * ends; and once the faults are over, a fresh sample comes within RECOVERY ticks. `tools/spin.sh` runs it, and each
 * twin below (-DTWIN_...), which takes one thing away and has to fail. Specification: section 4.
 */

#ifndef FAULTS
#define FAULTS 3
#endif
#define JITTER 2

#define T1_CYCLE 6      /* ID3: 62.5 us */
#define T1_OTHER 7      /* a background exchange */
#define REPLY 3         /* the reply is whole so many ticks after the start of the request */
#define DEADLINE 5      /* likewise, at the latest: the port's latency is in it */
#define LATENCY 3
#define PERIOD 16
#define MAX_HOLD (2 * PERIOD)
#define BOOT 30         /* of an encoder */
#define QUIET 6
#define LOST 3          /* failed cycles in a row after which the encoder is given up */
#define RETRIES 3       /* of start-up, behind the stage `answer` */
#define FRAMES 3        /* that have to agree: ID2, ID3 and consistent ones */
#define AGREE 3         /* readings, behind two that are missing */
#define PATIENCE 2      /* slots that an offer waits */
#define RECOVERY 60     /* with 50 it fails: three faults on end, the last one a restart */
#define LONG 60         /* counters stop there */

mtype = { quiet, answer, frames, running };      /* stages */
mtype = { cyclic, background, startup };         /* what an exchange is for */
mtype = { nothing, good, damaged };              /* what arrives */
mtype = { invalid, held, fresh };                /* samples */

/* The bus. */
mtype stage = quiet;
mtype kind = startup;
mtype sample = invalid;
bool waiting;          /* an exchange is under way */
bool request_bit;      /* tells its request from the one before */
byte since = LONG;     /* ticks since the last request started */
byte distance;         /* T1 of that request */
byte hold_off;
byte quiet_left = QUIET;
byte seen;             /* frames of start-up */
byte retries;
byte to_slot;
byte failed;           /* cycles in a row */
byte missed;           /* readings */
byte agree;
byte age = LONG;       /* of the newest good reply */
bool offered;
byte waited;           /* slots */

/* The line and the encoder. */
mtype arriving = nothing;
bool arriving_bit;
byte arrives_in;
byte down;             /* ticks until a restarted encoder answers */

byte faults_left = FAULTS;
byte unpolled;
byte calm;             /* ticks since the faults are over */
bool recovered;

inline tick() {
  if :: since < LONG -> since++ :: else fi;
  if :: age < LONG -> age++ :: else fi;
  if :: hold_off > 0 -> hold_off-- :: else fi;
  if :: quiet_left > 0 -> quiet_left-- :: else fi;
  if :: down > 0 -> down-- :: else fi;
  if :: stage == running && to_slot > 0 -> to_slot-- :: else fi;
  if :: arrives_in > 0 -> arrives_in-- :: else fi;
  if
  :: faults_left == 0 && down == 0 && !recovered ->
    calm++;
    assert(calm < RECOVERY)      /* bounded recovery */
  :: else
  fi
}

/* A request has started; what the encoder and the line make of it. */
inline line_takes_request() {
  if
  :: down > 0 -> skip            /* nobody is there */
  :: down == 0 ->
    if
    :: arriving = good; arriving_bit = request_bit; arrives_in = REPLY
    :: faults_left > 0 -> faults_left--; skip                       /* request or reply swallowed */
    :: faults_left > 0 -> faults_left--; arriving = damaged; arrives_in = REPLY
    :: faults_left > 0 -> faults_left--; arriving = good; arriving_bit = request_bit;
       arrives_in = DEADLINE + LATENCY                               /* handed out late */
    :: faults_left > 0 -> faults_left--; down = BOOT                 /* the supply failed */
    fi
  fi
}

inline send(what, t1) {
  assert(since >= distance);     /* T1, on the start bits */
  request_bit = !request_bit;
  kind = what;
  waiting = true;
  since = 0;
  distance = t1;
  if
  :: arriving != nothing && arrives_in > 0 -> skip   /* a late reply to the request before is on its way in */
  :: else -> arriving = nothing; line_takes_request()
  fi
}

inline begin_startup() {
  stage = quiet;
  quiet_left = QUIET;
  seen = 0;
  retries = 0;
  sample = invalid;
  offered = false;               /* told: bad_state */
  missed = 0;
  agree = 0
}

inline exchange_failed() {
  waiting = false;
#ifndef TWIN_SETTLE
  hold_off = LATENCY;
#endif
  if
  :: kind == cyclic ->
    failed++;
    if :: missed < 2 -> missed++ :: else fi;
    agree = 0;
    if :: sample == fresh -> sample = held :: else fi;
    if :: failed >= LOST -> begin_startup() :: else fi
  :: kind == startup && stage == frames ->
    retries++;
    if :: retries > RETRIES -> begin_startup() :: else fi
  :: kind == background -> offered = false
  :: else
  fi
}

inline position_is_good() {
  if
  :: missed < 2 || agree + 1 >= AGREE ->
    sample = fresh;
    age = since;
    missed = 0;
    agree = 0;
    if :: faults_left == 0 && down == 0 -> recovered = true :: else fi
  :: else -> agree++; if :: sample == fresh -> sample = held :: else fi
  fi
}

inline reply_is_good() {
  assert(arriving_bit == request_bit);   /* it answers this request and no other */
  waiting = false;
  if
  :: kind == cyclic -> failed = 0; position_is_good()
  :: kind == background -> offered = false
  :: kind == startup ->
    if
    :: stage == answer -> stage = frames; seen = 0; retries = 0
    :: stage == frames ->
      seen++;
      if
      :: seen >= FRAMES -> stage = running; to_slot = 0; failed = 0; missed = 0; agree = 0
      :: else
      fi
    :: else
    fi
  fi
}

inline receive() {
  if
  :: arriving != nothing && arrives_in == 0 ->
    if
    :: arriving == good && since <= DEADLINE -> reply_is_good()
    :: arriving == good && since > DEADLINE -> exchange_failed()
    :: arriving == damaged -> exchange_failed()
    fi;
    arriving = nothing
  :: else ->
#ifndef TWIN_TIMEOUT
    if :: since > DEADLINE -> exchange_failed() :: else fi
#endif
  fi
}

/* Nothing is under way: bytes that come now are stray, and what is due is sent. */
inline begin_due() {
  if
  :: arriving != nothing && arrives_in == 0 -> arriving = nothing;
    if :: stage == quiet -> quiet_left = QUIET :: else fi
  :: else
  fi;
  if
#ifdef TWIN_T1
  :: hold_off > 0 -> skip
#else
  :: hold_off > 0 || since < distance -> skip
#endif
  :: else ->
    if
    :: stage == quiet -> if :: quiet_left == 0 -> stage = answer :: else fi
    :: stage == answer || stage == frames -> send(startup, T1_CYCLE)
    :: stage == running && to_slot > 0 ->
      if
      :: offered && to_slot >= T1_OTHER -> send(background, T1_OTHER)   /* it fits before the next slot */
      :: else
      fi
    :: stage == running && to_slot == 0 ->
      to_slot = PERIOD;
      if
#ifndef TWIN_STARVES
      :: offered && waited == PATIENCE -> offered = false         /* told: no_gap */
#endif
      :: offered && waited != PATIENCE -> waited++
#ifdef TWIN_STARVES
      :: offered && waited == PATIENCE -> waited++
#endif
      :: !offered
      fi;
      send(cyclic, T1_CYCLE)
    fi
  fi
}

inline poll() {
  if :: waiting -> receive() :: !waiting -> begin_due() fi;
#ifndef TWIN_HOLD
  if :: sample != invalid && age > MAX_HOLD -> sample = invalid :: else fi;
#endif
  if
  :: stage == running && !offered && !waiting -> offered = true; waited = 0
  :: true -> skip
  fi
}

inline judge() {
  assert(!offered || waited <= PATIENCE);                                /* an offer ends */
  assert(!waiting || since <= DEADLINE + JITTER + 1);                    /* every wait is bounded */
  assert(sample != fresh || age <= PERIOD + DEADLINE + T1_OTHER + JITTER); /* nothing old is fresh */
  assert(sample == invalid || age <= MAX_HOLD + JITTER + 1)              /* held, but not for ever */
}

active proctype bus() {
  do
  :: recovered -> break
  :: else ->
    atomic {
      tick();
      if
      :: poll(); unpolled = 0
      :: unpolled < JITTER -> unpolled++
      fi;
      judge()
    }
  od
}
