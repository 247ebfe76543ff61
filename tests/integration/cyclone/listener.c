// Hears a world as another vendor's middleware does, under the type names that
// ROS 2 uses: one line per fact on standard output, for the test to judge.
//
// usage: listener SECONDS world FRAMES   joints, poses, the robot's description, and FRAMES transforms that move
//        listener SECONDS task           markers of a goal's scene, and of a plan
// Exit code 1 if a topic was not heard in that time.

#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "display.h"
#include "ros.h"

// The descriptor that idlc made, under the name ROS 2 gives the type.
static dds_entity_t reader_of(dds_entity_t participant, const dds_topic_descriptor_t* descriptor,
                              const char* type, const char* topic, dds_durability_kind_t durability) {
  dds_topic_descriptor_t renamed = *descriptor;
  renamed.m_typename = type;
  const dds_entity_t entity = dds_create_topic(participant, &renamed, topic, NULL, NULL);
  // Reliable, as a ROS 2 subscriber asks for by default.
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, durability);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  const dds_entity_t reader = dds_create_reader(participant, entity, qos, NULL);
  dds_delete_qos(qos);
  if (reader < 0) {
    fprintf(stderr, "%s: %s\n", topic, dds_strretcode(-reader));
    exit(2);
  }
  return reader;
}

// The next sample, or NULL at the deadline. Never given back: this process is
// about to end.
static void* take(dds_entity_t reader, dds_time_t deadline) {
  while (dds_time() < deadline) {
    void* sample = NULL;
    dds_sample_info_t info;
    if (dds_take(reader, &sample, &info, 1, 1) == 1 && info.valid_data) return sample;
    dds_sleepfor(DDS_MSECS(10));
  }
  return NULL;
}

static int not_heard(const char* topic) {
  fprintf(stderr, "not heard: %s\n", topic);
  return 1;
}

static void print_transforms(const char* word, const tf2_msgs_msg_TFMessage* message) {
  for (uint32_t i = 0; i < message->transforms._length; ++i) {
    const geometry_msgs_msg_TransformStamped* transform = &message->transforms._buffer[i];
    printf("%s %s %s %.17g %.17g %.17g\n", word, transform->header.frame_id, transform->child_frame_id,
           transform->transform.translation.x, transform->transform.translation.y,
           transform->transform.translation.z);
  }
}

static int hear_world(dds_entity_t participant, dds_time_t deadline, uint32_t frames) {
  const dds_entity_t joints =
      reader_of(participant, &sensor_msgs_msg_JointState_desc, "sensor_msgs::msg::dds_::JointState_",
                "rt/joint_states", DDS_DURABILITY_VOLATILE);
  const dds_entity_t poses =
      reader_of(participant, &geometry_msgs_msg_PoseArray_desc, "geometry_msgs::msg::dds_::PoseArray_",
                "rt/objects/poses", DDS_DURABILITY_VOLATILE);
  const dds_entity_t transforms = reader_of(participant, &tf2_msgs_msg_TFMessage_desc,
                                            "tf2_msgs::msg::dds_::TFMessage_", "rt/tf", DDS_DURABILITY_VOLATILE);
  // What was said once, before anybody listened.
  const dds_entity_t fixed =
      reader_of(participant, &tf2_msgs_msg_TFMessage_desc, "tf2_msgs::msg::dds_::TFMessage_", "rt/tf_static",
                DDS_DURABILITY_TRANSIENT_LOCAL);
  const dds_entity_t descriptions = reader_of(participant, &std_msgs_msg_String_desc, "std_msgs::msg::dds_::String_",
                                              "rt/robot_description", DDS_DURABILITY_TRANSIENT_LOCAL);

  const sensor_msgs_msg_JointState* state = take(joints, deadline);
  if (!state) return not_heard("rt/joint_states");
  printf("joints %u %u %u\n", state->name._length, state->position._length, state->velocity._length);
  for (uint32_t i = 0; i < state->name._length && i < state->position._length; ++i) {
    printf("joint %s %.17g\n", state->name._buffer[i], state->position._buffer[i]);
  }
  const geometry_msgs_msg_PoseArray* array = take(poses, deadline);
  if (!array) return not_heard("rt/objects/poses");
  printf("frame %s\n", array->header.frame_id);
  for (uint32_t i = 0; i < array->poses._length; ++i) {
    const geometry_msgs_msg_Pose* pose = &array->poses._buffer[i];
    printf("pose %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", pose->position.x, pose->position.y,
           pose->position.z, pose->orientation.w, pose->orientation.x, pose->orientation.y,
           pose->orientation.z);
  }
  const tf2_msgs_msg_TFMessage* root = take(fixed, deadline);
  if (!root) return not_heard("rt/tf_static");
  print_transforms("static", root);
  const std_msgs_msg_String* description = take(descriptions, deadline);
  if (!description) return not_heard("rt/robot_description");
  const char* robot = strstr(description->data, "<robot");
  printf("description %.32s\n", robot ? robot : "none");
  // Objects and robot speak for themselves, in turns: what comes until all were heard, some perhaps twice.
  for (uint32_t heard = 0; heard < frames;) {
    const tf2_msgs_msg_TFMessage* tf = take(transforms, deadline);
    if (!tf) return not_heard("rt/tf");
    static char seen[64][64];
    for (uint32_t i = 0; i < tf->transforms._length && heard < 64; ++i) {
      uint32_t known = 0;
      while (known < heard && strncmp(seen[known], tf->transforms._buffer[i].child_frame_id, 63) != 0) ++known;
      if (known == heard) strncpy(seen[heard++], tf->transforms._buffer[i].child_frame_id, 63);
    }
    print_transforms("transform", tf);
  }
  return 0;
}

static int hear_task(dds_entity_t participant, dds_time_t deadline) {
  const char* topics[] = {"rt/task/scene_markers", "rt/task/plan_markers"};
  const char* words[] = {"scene", "plan"};
  for (int i = 0; i < 2; ++i) {
    const dds_entity_t reader =
        reader_of(participant, &visualization_msgs_msg_MarkerArray_desc, "visualization_msgs::msg::dds_::MarkerArray_",
                  topics[i], DDS_DURABILITY_TRANSIENT_LOCAL);
    const visualization_msgs_msg_MarkerArray* array = NULL;
    do {  // before the first plan there is only the word that deletes others
      array = take(reader, deadline);
      if (!array) return not_heard(topics[i]);
    } while (array->markers._length < 2);
    for (uint32_t k = 0; k < array->markers._length; ++k) {
      const visualization_msgs_msg_Marker* marker = &array->markers._buffer[k];
      printf("%s %d %d %u %s %s\n", words[i], marker->action, marker->type, marker->points._length,
             marker->ns[0] ? marker->ns : "-", marker->header.frame_id[0] ? marker->header.frame_id : "-");
    }
  }
  return 0;
}

int main(int argc, char** argv) {
  if (argc < 3 || (argc < 4 && strcmp(argv[2], "task") != 0)) return 2;
  const char* domain = getenv("ROS_DOMAIN_ID");
  const dds_entity_t participant =
      dds_create_participant(domain ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL);
  if (participant < 0) {
    fprintf(stderr, "participant: %s\n", dds_strretcode(-participant));
    return 2;
  }
  const dds_time_t deadline = dds_time() + DDS_SECS(atoi(argv[1]));
  const int code = strcmp(argv[2], "task") == 0 ? hear_task(participant, deadline)
                                                : hear_world(participant, deadline, (uint32_t)atoi(argv[3]));
  dds_delete(participant);
  return code;
}
