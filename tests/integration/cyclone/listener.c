// Hears a world as another vendor's middleware does, under the type names that
// ROS 2 uses: one line per fact on standard output, for the test to judge.
//
// usage: listener SECONDS; exit code 1 if a topic was not heard in that time.

#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>

#include "ros.h"

// The descriptor that idlc made, under the name ROS 2 gives the type.
static dds_entity_t reader_of(dds_entity_t participant, const dds_topic_descriptor_t* descriptor,
                              const char* type, const char* topic) {
  dds_topic_descriptor_t renamed = *descriptor;
  renamed.m_typename = type;
  const dds_entity_t entity = dds_create_topic(participant, &renamed, topic, NULL, NULL);
  // Reliable, as a ROS 2 subscriber asks for by default.
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
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

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const char* domain = getenv("ROS_DOMAIN_ID");
  const dds_entity_t participant =
      dds_create_participant(domain ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL);
  if (participant < 0) {
    fprintf(stderr, "participant: %s\n", dds_strretcode(-participant));
    return 2;
  }
  const dds_entity_t joints = reader_of(participant, &sensor_msgs_msg_JointState_desc,
                                        "sensor_msgs::msg::dds_::JointState_", "rt/joint_states");
  const dds_entity_t poses = reader_of(participant, &geometry_msgs_msg_PoseArray_desc,
                                       "geometry_msgs::msg::dds_::PoseArray_", "rt/objects/poses");
  const dds_entity_t transforms = reader_of(participant, &tf2_msgs_msg_TFMessage_desc,
                                            "tf2_msgs::msg::dds_::TFMessage_", "rt/tf");

  const dds_time_t deadline = dds_time() + DDS_SECS(atoi(argv[1]));
  const sensor_msgs_msg_JointState* state = take(joints, deadline);
  const geometry_msgs_msg_PoseArray* array = take(poses, deadline);
  const tf2_msgs_msg_TFMessage* tf = take(transforms, deadline);
  if (!state || !array || !tf) {
    fprintf(stderr, "not heard:%s%s%s\n", state ? "" : " rt/joint_states", array ? "" : " rt/objects/poses",
            tf ? "" : " rt/tf");
    return 1;
  }

  printf("joints %u %u %u\n", state->name._length, state->position._length, state->velocity._length);
  for (uint32_t i = 0; i < state->name._length && i < state->position._length; ++i) {
    printf("joint %s %.17g\n", state->name._buffer[i], state->position._buffer[i]);
  }
  printf("frame %s\n", array->header.frame_id);
  for (uint32_t i = 0; i < array->poses._length; ++i) {
    const geometry_msgs_msg_Pose* pose = &array->poses._buffer[i];
    printf("pose %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", pose->position.x, pose->position.y,
           pose->position.z, pose->orientation.w, pose->orientation.x, pose->orientation.y,
           pose->orientation.z);
  }
  for (uint32_t i = 0; i < tf->transforms._length; ++i) {
    printf("transform %s %s\n", tf->transforms._buffer[i].header.frame_id,
           tf->transforms._buffer[i].child_frame_id);
  }
  dds_delete(participant);
  return 0;
}
