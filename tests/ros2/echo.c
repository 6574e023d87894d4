/* Sends back what it receives, decoded and encoded again, with Eclipse Cyclone DDS in C: echo DOMAIN QOS
 *
 * As echo.py. The types are those that idlc makes of messages.idl; the table of them is in kinds.h, which the test
 * writes: one line KIND(package, name) for each.
 */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "messages.h"

struct kind {
  const char *name;
  const dds_topic_descriptor_t *type;
};

#define KIND(package, name) {#package "/" #name, &package##_msg_dds__##name##__desc},
static const struct kind kinds[] = {
#include "kinds.h"
};
enum { KINDS = sizeof kinds / sizeof kinds[0], BATCH = 32 };

static dds_entity_t reader[KINDS], writer[KINDS];

static dds_qos_t *policy(const char *name) {
  dds_qos_t *qos = dds_create_qos();
  int best_effort = strcmp(name, "best_effort") == 0, latched = strcmp(name, "latched") == 0;
  dds_qset_reliability(qos, best_effort ? DDS_RELIABILITY_BEST_EFFORT : DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, latched ? 1 : 100);
  return qos;
}

static dds_entity_t check(dds_entity_t entity, const char *what) {
  if (entity < 0) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(-entity));
    exit(1);
  }
  return entity;
}

int main(int argc, char **argv) {
  if (argc != 3) return 2;
  dds_entity_t participant = check(dds_create_participant(atoi(argv[1]), NULL, NULL), "participant");
  dds_entity_t waits = check(dds_create_waitset(participant), "waitset");
  dds_qos_t *qos = policy(argv[2]);
  char line[256], topic[300];
  while (fgets(line, sizeof line, stdin) && line[0] != '\n') {
    line[strcspn(line, "\n")] = 0;
    size_t i = 0;
    while (i < KINDS && strcmp(kinds[i].name, line) != 0) i++;
    if (i == KINDS) {
      fprintf(stderr, "no type %s\n", line);
      return 1;
    }
    snprintf(topic, sizeof topic, "rt/echo/in/%s", line);
    dds_entity_t in = check(dds_create_topic(participant, kinds[i].type, topic, qos, NULL), topic);
    snprintf(topic, sizeof topic, "rt/echo/out/%s", line);
    dds_entity_t out = check(dds_create_topic(participant, kinds[i].type, topic, qos, NULL), topic);
    reader[i] = check(dds_create_reader(participant, in, qos, NULL), "reader");
    writer[i] = check(dds_create_writer(participant, out, qos, NULL), "writer");
    dds_entity_t news = check(dds_create_readcondition(reader[i], DDS_ANY_STATE), "condition");
    check(dds_waitset_attach(waits, news, (dds_attach_t)i), "attach");
  }
  printf("ready\n");
  fflush(stdout);
  for (;;) {
    dds_attach_t triggered[KINDS];
    int n = dds_waitset_wait(waits, triggered, KINDS, DDS_SECS(1));
    for (int k = 0; k < n && k < KINDS; k++) {
      size_t i = (size_t)triggered[k];
      void *samples[BATCH] = {NULL};
      dds_sample_info_t infos[BATCH];
      int taken = dds_take(reader[i], samples, infos, BATCH, BATCH);
      for (int s = 0; s < taken; s++)
        if (infos[s].valid_data) dds_write(writer[i], samples[s]);
      if (taken > 0) dds_return_loan(reader[i], samples, taken);
    }
  }
}
