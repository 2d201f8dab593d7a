/* One process of krait bench's relay over Eclipse Cyclone DDS: source, relay-1, relay-2 or sink.
 *
 * The same loops as bench/src/relay.rs, and the same files left behind. Best effort, keep last, a WaitSet to wait; one
 * topic per hop, on the loopback interface only. All numbers come from `krait bench` as options; whatever goes wrong is
 * one sentence on standard error and exit code 1. */
#include "message.h"
#include <dds/dds.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>

enum { N_HOPS = 3, HEADER_WORDS = 2 + N_HOPS };
/* A relay that hears nothing for this long ends, ns. */
#define PATIENCE_NS 1000000000LL
/* A writer that finds no reader by then will not, ns. */
#define MATCH_PATIENCE_NS 10000000000LL
/* From the writer's knowing its reader to the reader's knowing its writer, ns: both learn it from the same exchange. */
#define SETTLE_NS 200000000LL
/* Samples in a reader's history, as krait's stages have. */
#define DEPTH 256
/* A domain that nobody has by default, so that a robot's own is left alone; its ports are 26650 to 26899. */
#define DOMAIN 77
#define LAST (1ULL << 63)
#define MEASURED (1ULL << 62)

static const char *const CONFIG =
    "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface address=\"127.0.0.1\" multicast=\"false\"/>"
    "</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>99</MaxAutoParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>"
    "</Domain></CycloneDDS>";
static const char *const ROLES[] = {"source", "relay-1", "relay-2", "sink"};

struct options {
  int role;
  const char *folder, *prefix;
  double rate_hz, warm_up_s, round_s;
  size_t payload_bytes;
  bool is_polling, locks_memory;
};

struct usage { uint64_t cpu_ns, n_switches, wall_ns; };

struct relay {
  struct options options;
  dds_entity_t reader, wait_set, writer;
  uint64_t *message, n_messages;
  /* At the end of the warm-up; zero until then. */
  struct usage before;
};

static void die(const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  fputs("krait-relay-cyclonedds: ", stderr);
  vfprintf(stderr, format, arguments);
  fputs("\n", stderr);
  va_end(arguments);
  exit(1);
}

static int32_t ok(int32_t result, const char *doing) {
  if (result < 0) die("%s failed: %s", doing, dds_strretcode(-result));
  return result;
}

static int64_t clock_ns(clockid_t clock) {
  struct timespec now;
  clock_gettime(clock, &now);
  return now.tv_sec * 1000000000LL + now.tv_nsec;
}

static int64_t monotonic_ns(void) { return clock_ns(CLOCK_MONOTONIC); }

/* Of all threads together. */
static struct usage usage_now(void) {
  struct rusage rusage;
  getrusage(RUSAGE_SELF, &rusage);
  return (struct usage){.cpu_ns = (uint64_t)clock_ns(CLOCK_PROCESS_CPUTIME_ID),
                        .n_switches = (uint64_t)(rusage.ru_nvcsw + rusage.ru_nivcsw),
                        .wall_ns = (uint64_t)monotonic_ns()};
}

/* Counts the message; whether it was the last one. */
static bool is_last(struct relay *relay) {
  relay->n_messages += 1;
  if ((relay->message[0] & MEASURED) && relay->before.wall_ns == 0) relay->before = usage_now();
  return (relay->message[0] & LAST) != 0;
}

/* Leaves a file in the folder of the round. */
static void leave(const struct options *options, const char *name, const char *ending, const void *bytes, size_t size) {
  char path[4096];
  snprintf(path, sizeof path, "%s/%s%s", options->folder, name, ending);
  FILE *file = fopen(path, "wb");
  if (!file || fwrite(bytes, 1, size, file) != size || fclose(file)) die("%s could not be written: %m", path);
}

/* Takes the next message; false when none came for the patience. */
static bool receive(struct relay *relay) {
  const int64_t give_up_ns = monotonic_ns() + PATIENCE_NS;
  for (;;) {
    void *samples[1] = {NULL};
    dds_sample_info_t info[1];
    if (ok(dds_take(relay->reader, samples, info, 1, 1), "taking") > 0) {
      const krait_Message *taken = samples[0];
      const bool is_whole = info[0].valid_data && taken->payload._length == relay->options.payload_bytes;
      if (is_whole) memcpy(relay->message, taken->payload._buffer, relay->options.payload_bytes);
      ok(dds_return_loan(relay->reader, samples, 1), "returning a loan");
      if (is_whole) return true;
      continue;
    }
    const int64_t left_ns = give_up_ns - monotonic_ns();
    if (left_ns <= 0) return false;
    if (!relay->options.is_polling) ok(dds_waitset_wait(relay->wait_set, NULL, 0, left_ns), "waiting");
  }
}

static void send_on(struct relay *relay) {
  const uint32_t size = (uint32_t)relay->options.payload_bytes;
  krait_Message message = {
      .payload = {._maximum = size, ._length = size, ._buffer = (uint8_t *)relay->message, ._release = false}};
  ok(dds_write(relay->writer, &message), "writing");
}

static void run_source(struct relay *relay) {
  const struct options *options = &relay->options;
  const int64_t period_ns = (int64_t)(1e9 / options->rate_hz);
  int64_t due_ns = monotonic_ns();
  const int64_t measured_ns = due_ns + (int64_t)(options->warm_up_s * 1e9);
  const int64_t end_ns = measured_ns + (int64_t)(options->round_s * 1e9);
  while (due_ns < end_ns) {
    /* A late tick is not made up for by a burst. */
    const int64_t late_ns = monotonic_ns() - due_ns;
    due_ns += ((late_ns > 0 ? late_ns / period_ns : 0) + 1) * period_ns;
    const struct timespec due = {.tv_sec = due_ns / 1000000000LL, .tv_nsec = due_ns % 1000000000LL};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
    const uint64_t flags = (due_ns >= measured_ns ? MEASURED : 0) | (due_ns >= end_ns ? LAST : 0);
    relay->message[0] = (relay->n_messages + 1) | flags;
    relay->message[1] = (uint64_t)monotonic_ns();
    send_on(relay);
    is_last(relay);
  }
}

static void run_relay(struct relay *relay) {
  while (receive(relay)) {
    relay->message[1 + relay->options.role] = (uint64_t)monotonic_ns();
    send_on(relay);
    if (is_last(relay)) return;
  }
}

static void run_sink(struct relay *relay) {
  const struct options *options = &relay->options;
  const size_t n_most = (size_t)((options->round_s + 1.0) * options->rate_hz);
  uint64_t(*samples)[HEADER_WORDS] = malloc(n_most * sizeof *samples);
  size_t n_samples = 0;
  if (!samples) die("%zu samples do not fit into memory", n_most);
  while (receive(relay)) {
    relay->message[1 + N_HOPS] = (uint64_t)monotonic_ns();
    if ((relay->message[0] & MEASURED) && n_samples < n_most) {
      memcpy(samples[n_samples], relay->message, sizeof *samples);
      samples[n_samples++][0] &= ~(LAST | MEASURED);
    }
    if (is_last(relay)) break;
  }
  leave(options, "samples", ".bin", samples, n_samples * sizeof *samples);
}

static dds_entity_t hop_topic(dds_entity_t participant, const struct options *options, int hop) {
  char name[256];
  snprintf(name, sizeof name, "%shop%d", options->prefix, hop);
  for (char *letter = name; *letter; letter++) {
    if (*letter == '-' || *letter == '.') *letter = '_';
  }
  return ok(dds_create_topic(participant, &krait_Message_desc, name, NULL, NULL), "making a topic");
}

static void open_ways(struct relay *relay) {
  const struct options *options = &relay->options;
  ok(dds_create_domain(DOMAIN, CONFIG), "configuring the domain");
  const dds_entity_t participant = ok(dds_create_participant(DOMAIN, NULL, NULL), "making a participant");
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, DEPTH);
  if (options->role > 0) {
    const dds_entity_t topic = hop_topic(participant, options, options->role - 1);
    relay->reader = ok(dds_create_reader(participant, topic, qos, NULL), "making a reader");
    const dds_entity_t condition = ok(dds_create_readcondition(relay->reader, DDS_ANY_STATE), "making a condition");
    relay->wait_set = ok(dds_create_waitset(participant), "making a wait set");
    ok(dds_waitset_attach(relay->wait_set, condition, 0), "attaching to the wait set");
  }
  if (options->role < N_HOPS) {
    const dds_entity_t topic = hop_topic(participant, options, options->role);
    relay->writer = ok(dds_create_writer(participant, topic, qos, NULL), "making a writer");
    dds_publication_matched_status_t matched = {0};
    for (const int64_t give_up_ns = monotonic_ns() + MATCH_PATIENCE_NS; matched.current_count == 0;) {
      if (monotonic_ns() > give_up_ns) die("no reader of hop %d was found within 10 s", options->role + 1);
      dds_sleepfor(DDS_MSECS(2));
      ok(dds_get_publication_matched_status(relay->writer, &matched), "looking for the reader");
    }
    dds_sleepfor(SETTLE_NS);
  }
  dds_delete_qos(qos);
}

static const char *option(char **arguments, const char *name) {
  for (; arguments[0] && arguments[1]; arguments++) {
    if (strcmp(arguments[0], name) == 0) return arguments[1];
  }
  die("%s is missing: this program is started by `krait bench`", name);
  return NULL;
}

static struct options parse(char **arguments) {
  struct options found = {.folder = option(arguments, "--folder"),
                          .prefix = option(arguments, "--prefix"),
                          .rate_hz = atof(option(arguments, "--rate-hz")),
                          .warm_up_s = atof(option(arguments, "--warm-up-s")),
                          .round_s = atof(option(arguments, "--round-s")),
                          .payload_bytes = strtoul(option(arguments, "--payload-bytes"), NULL, 10),
                          .is_polling = strcmp(option(arguments, "--wait"), "polling") == 0,
                          .locks_memory = strcmp(option(arguments, "--lock-memory"), "true") == 0};
  const char *const role = option(arguments, "--role");
  while (found.role <= N_HOPS && strcmp(ROLES[found.role], role) != 0) found.role++;
  if (found.role > N_HOPS) die("--role is %s: expected source, relay-1, relay-2 or sink", role);
  if (!(found.rate_hz >= 1.0 && found.round_s > 0.0 && found.payload_bytes >= HEADER_WORDS * sizeof(uint64_t))) {
    die("--rate-hz, --round-s or --payload-bytes is out of range: this program is started by `krait bench`");
  }
  return found;
}

int main(int n_arguments, char **arguments) {
  struct relay relay = {.options = parse(arguments + (n_arguments > 0))};
  const struct options *options = &relay.options;
  const char *const role = ROLES[options->role];
  relay.message = calloc(options->payload_bytes / sizeof(uint64_t) + 1, sizeof(uint64_t));
  if (!relay.message) die("%zu bytes do not fit into memory", options->payload_bytes);
  memset(relay.message, 0xa5, options->payload_bytes);
  open_ways(&relay);
  if (options->locks_memory) mlockall(MCL_CURRENT | MCL_FUTURE); /* A refusal has been told by `krait bench`. */
  leave(options, role, ".ready", "ready", 5);
  if (options->role == 0) run_source(&relay);
  else if (options->role < N_HOPS) run_relay(&relay);
  else run_sink(&relay);
  const struct usage now = usage_now(), before = relay.before.wall_ns ? relay.before : now;
  char text[256];
  const int n_letters =
      snprintf(text, sizeof text, "{\"n_messages\":%ju,\"usage\":{\"cpu_ns\":%ju,\"n_switches\":%ju,\"wall_ns\":%ju}}",
               (uintmax_t)relay.n_messages, (uintmax_t)(now.cpu_ns - before.cpu_ns),
               (uintmax_t)(now.n_switches - before.n_switches), (uintmax_t)(now.wall_ns - before.wall_ns));
  leave(options, role, ".json", text, (size_t)n_letters);
  return 0;
}
