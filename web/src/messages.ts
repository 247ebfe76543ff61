// What the page reads of ROS 2 messages; idl/msg has every field with its unit.

export interface Time {
  sec: number;
  nanosec: number;
}

export interface Pose {
  position: { x: number; y: number; z: number };
  orientation: { x: number; y: number; z: number; w: number };
}

export interface ObjectStates {
  objects: { name: string; pose: Pose }[];
}

export interface JointState {
  name: string[];
  position: Float64Array;
}

export interface TaskRun {
  goal: { goal_id: string; execution_scene: string; controller: string };
}

export interface Plan {
  number: number;
  q: Float64Array; // [nq]
  states: Float64Array; // [n + 1][nq]
  cost: number;
  at_goal: boolean;
}

export interface Feedback {
  phase: string;
  cost: number;
  target_distance: number; // m
  actions: number;
  replans: number;
  rollouts: bigint;
  elapsed: number; // s
  workers: { alive: boolean }[];
  unit: string;
  trouble: string;
}

export interface GoalResult {
  success: boolean;
  reason: string;
  error: string;
}
