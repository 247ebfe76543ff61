// A client of an action as rmw_cyclonedds makes it of ROS 2's: one line per fact on standard output, for the test to
// judge.
//
// usage: action_client SECONDS NAME SCENE PARAMETERS perform   sends a goal, and hears of it until its result is there
//        action_client SECONDS NAME SCENE PARAMETERS cancel    and cancels it as soon as it is planned
//   NAME: of the action, "grasp"; SCENE, PARAMETERS: files
// Exit code 1 if something was not heard in that time.

#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "action.h"
#include "rmw_cyclonedds.h"

// A topic under the names that ROS 2 gives it and its type.
static dds_entity_t topic_of(dds_entity_t participant, const dds_topic_descriptor_t* descriptor, const char* type,
                             const char* prefix, const char* action, const char* suffix) {
  dds_topic_descriptor_t renamed = *descriptor;
  renamed.m_typename = type;
  char name[256];
  snprintf(name, sizeof name, "%s/%s/_action/%s", prefix, action, suffix);
  const dds_entity_t topic = dds_create_topic(participant, &renamed, name, NULL, NULL);
  if (topic < 0) {
    fprintf(stderr, "%s: %s\n", name, dds_strretcode(-topic));
    exit(2);
  }
  return topic;
}

static dds_entity_t reader_of(dds_entity_t participant, dds_entity_t topic, dds_durability_kind_t durability) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  const dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return reader;
}

static dds_entity_t writer_of(dds_entity_t participant, dds_entity_t topic) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  const dds_entity_t writer = dds_create_writer(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return writer;
}

// The next sample, or NULL at the deadline. Never given back: this process is about to end.
static void* take(dds_entity_t reader, dds_time_t deadline) {
  while (dds_time() < deadline) {
    void* sample = NULL;
    dds_sample_info_t info;
    if (dds_take(reader, &sample, &info, 1, 1) == 1 && info.valid_data) return sample;
    dds_sleepfor(DDS_MSECS(10));
  }
  return NULL;
}

static int not_heard(const char* what) {
  fprintf(stderr, "not heard: %s\n", what);
  return 1;
}

// A service's client: as long as neither side was found, requests go nowhere.
struct client {
  dds_entity_t requests, answers;
};

static int is_found(const struct client* client, dds_time_t deadline) {
  while (dds_time() < deadline) {
    dds_publication_matched_status_t there;
    dds_subscription_matched_status_t back;
    if (dds_get_publication_matched_status(client->requests, &there) == 0 && there.current_count > 0 &&
        dds_get_subscription_matched_status(client->answers, &back) == 0 && back.current_count > 0)
      return 1;
    dds_sleepfor(DDS_MSECS(10));
  }
  return 0;
}

// What every answer begins with.
struct envelope {
  uint64_t client;
  int64_t number;
};

// The answer to this request; others are counted.
static void* take_answer(const struct client* client, uint64_t id, int64_t number, dds_time_t deadline) {
  for (int others = 0;; ++others) {
    struct envelope* answer = take(client->answers, deadline);
    if (!answer) return NULL;
    if (answer->client != id || answer->number != number) continue;
    printf("others %d\n", others);
    return answer;
  }
}

static char* text_of(const char* path) {
  FILE* file = fopen(path, "rb");
  if (!file) exit(2);
  static char buffers[2][1 << 20];
  static int next = 0;
  char* text = buffers[next++];
  text[fread(text, 1, sizeof buffers[0] - 1, file)] = 0;
  fclose(file);
  return text;
}

int main(int argc, char** argv) {
  if (argc != 6) return 2;
  const char* action = argv[2];
  const int cancels = strcmp(argv[5], "cancel") == 0;
  const char* domain = getenv("ROS_DOMAIN_ID");
  const dds_entity_t participant = dds_create_participant(domain ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL);
  if (participant < 0) {
    fprintf(stderr, "participant: %s\n", dds_strretcode(-participant));
    return 2;
  }
  const dds_time_t deadline = dds_time() + DDS_SECS(atoi(argv[1]));
  const uint64_t id = (uint64_t)dds_time() ^ ((uint64_t)getpid() << 32);

#define CLIENT(Type, package, kind, name, suffix)                                                                    \
  {writer_of(participant, topic_of(participant, &rmw_##Type##_Request_desc, package "::" kind "::dds_::" name "_Request_", \
                                   "rq", action, suffix "Request")),                                                 \
   reader_of(participant, topic_of(participant, &rmw_##Type##_Response_desc,                                         \
                                   package "::" kind "::dds_::" name "_Response_", "rr", action, suffix "Reply"),    \
             DDS_DURABILITY_VOLATILE)}
  const struct client goals = CLIENT(SendGoal, "jostle_msgs", "action", "Manipulate_SendGoal", "send_goal");
  const struct client results = CLIENT(GetResult, "jostle_msgs", "action", "Manipulate_GetResult", "get_result");
  const struct client cancelling = CLIENT(CancelGoal, "action_msgs", "srv", "CancelGoal", "cancel_goal");
  const dds_entity_t feedback =
      reader_of(participant, topic_of(participant, &jostle_msgs_action_Manipulate_FeedbackMessage_desc,
                                      "jostle_msgs::action::dds_::Manipulate_FeedbackMessage_", "rt", action, "feedback"),
                DDS_DURABILITY_VOLATILE);
  const dds_entity_t statuses =
      reader_of(participant, topic_of(participant, &action_msgs_msg_GoalStatusArray_desc,
                                      "action_msgs::msg::dds_::GoalStatusArray_", "rt", action, "status"),
                DDS_DURABILITY_TRANSIENT_LOCAL);
  if (!is_found(&goals, deadline) || !is_found(&results, deadline) || !is_found(&cancelling, deadline))
    return not_heard("the action's services");

  rmw_SendGoal_Request request = {.client = id, .number = 1};
  memcpy(request.data.goal_id.uuid, &id, sizeof id);
  request.data.goal_id.uuid[15] = 1;
  request.data.goal.goal.goal_id = "";
  request.data.goal.goal.execution_scene = text_of(argv[3]);
  request.data.goal.goal.planning_scene = "";
  request.data.goal.goal.parameters = text_of(argv[4]);
  request.data.goal.goal.controller = "";
  request.data.goal.goal.predictor = "";
  request.data.goal.goal.seed = 1;
  dds_write(goals.requests, &request);
  const rmw_SendGoal_Response* accepted = take_answer(&goals, id, 1, deadline);
  if (!accepted) return not_heard("whether the goal is accepted");
  printf("accepted %d %d\n", accepted->data.accepted, accepted->data.stamp.sec > 0);
  if (!accepted->data.accepted) return 0;

  // Somebody else asks for the result, too, and again for one that there is not.
  rmw_GetResult_Request ask = {.client = id, .number = 2, .data = {.goal_id = request.data.goal_id}};
  rmw_GetResult_Request other = ask;
  other.client = ~id;
  other.data.goal_id.uuid[15] = 2;
  dds_write(results.requests, &other);
  dds_write(results.requests, &ask);

  int count = 0;
  for (int planning = 0; !planning;) {
    const jostle_msgs_action_Manipulate_FeedbackMessage* message = take(feedback, deadline);
    if (!message) return not_heard("feedback");
    if (memcmp(&message->goal_id, &request.data.goal_id, sizeof message->goal_id) != 0) continue;
    ++count;
    planning = strcmp(message->feedback.feedback.phase, "preparing") != 0;
  }
  printf("feedback %d\n", count > 0);
  if (cancels) {
    rmw_CancelGoal_Request cancel = {.client = id, .number = 3};
    cancel.data.goal_info.goal_id = request.data.goal_id;
    dds_write(cancelling.requests, &cancel);
    const rmw_CancelGoal_Response* answer = take_answer(&cancelling, id, 3, deadline);
    if (!answer) return not_heard("whether it is cancelled");
    printf("cancel %d %u\n", answer->data.return_code, answer->data.goals_canceling._length);
  }
  const rmw_GetResult_Response* result = take_answer(&results, id, 2, deadline);
  if (!result) return not_heard("the result");
  const jostle_msgs_msg_GoalResult* told = &result->data.result.result;
  printf("result %d %d %d %d\n", result->data.status, told->success, told->ending, told->report[0] == '{');
  printf("reason %s\n", told->reason);
  for (;;) {  // of the statuses: those of this goal, until its last one
    const action_msgs_msg_GoalStatusArray* array = take(statuses, deadline);
    if (!array) return not_heard("the last status");
    for (uint32_t i = 0; i < array->status_list._length; ++i) {
      const action_msgs_msg_GoalStatus* status = &array->status_list._buffer[i];
      if (memcmp(&status->goal_info.goal_id, &request.data.goal_id, sizeof request.data.goal_id) != 0) continue;
      printf("status %d\n", status->status);
      if (status->status >= 4) {
        dds_delete(participant);
        return 0;
      }
    }
  }
}
