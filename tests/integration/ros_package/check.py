# The package jostle_msgs as ROS 2's own tools take it, as far as Debian has them: its .msg and .action files become IDL,
# the IDL is parsed, C++ is generated from it and compiled; and what they make of the action is what goes over the wire.
# usage: check.py PROGRAM IDL: what writes packages; the IDL of the action

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

from rosidl_adapter.action import convert_action_to_idl
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_adapter.srv import convert_srv_to_idl
from rosidl_cli.command.helpers import legacy_generator_arguments_file
from rosidl_generator_cpp import generate_cpp
from rosidl_parser.definition import Action, BasicType, IdlLocator, Message
from rosidl_parser.parser import parse_idl_file

PROGRAM = sys.argv.pop(1)
ACTION = sys.argv.pop(1)
TEMPLATES = pathlib.Path("/usr/share/rosidl_generator_cpp/resource")
OTHERS = ["builtin_interfaces", "std_msgs", "geometry_msgs", "unique_identifier_msgs", "action_msgs"]  # that ROS 2 brings
CONVERTERS = {"msg": convert_msg_to_idl, "srv": convert_srv_to_idl, "action": convert_action_to_idl}


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory(prefix="jostle-ros-")
        cls.root = pathlib.Path(cls.temporary.name)
        for name in ["jostle_msgs"] + OTHERS:
            subprocess.run([PROGRAM, cls.root / name, "1.2.3", name], check=True)
        cls.files = sorted((cls.root / "jostle_msgs" / "msg").glob("*.msg"))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def idl_of(self, package):
        """Files of a package as IDL, made on the first call."""
        folder = self.root / "idl" / package
        if not folder.exists():
            for kind, convert in CONVERTERS.items():
                for file in sorted((self.root / package).glob(f"{kind}/*.{kind}")):
                    convert(self.root / package, package, pathlib.Path(kind) / file.name, folder / kind)
        return sorted(folder.glob("*/*.idl"))

    def test_has_every_message_and_a_manifest_that_agrees(self):
        manifest = xml.etree.ElementTree.parse(self.root / "jostle_msgs" / "package.xml").getroot()
        self.assertEqual(manifest.findtext("name"), "jostle_msgs")
        self.assertEqual(manifest.findtext("version"), "1.2.3")
        self.assertEqual(manifest.findtext("member_of_group"), "rosidl_interface_packages")
        depends = sorted(element.text for element in manifest.findall("depend"))
        build = (self.root / "jostle_msgs" / "CMakeLists.txt").read_text()
        listed = re.findall(r"^  (\w+/\w+\.\w+)$", build, re.M)
        self.assertEqual(listed, ["msg/" + file.name for file in self.files] + ["action/Manipulate.action"])
        self.assertEqual(re.search(r"DEPENDENCIES (.*)\)", build).group(1).split(), depends)
        self.assertEqual(depends, ["action_msgs", "builtin_interfaces", "geometry_msgs", "std_msgs"])
        for message in ["Goal", "Plan", "Feedback", "ObjectStates", "RobotStatus"]:
            self.assertIn(f"msg/{message}.msg", listed)

    def test_is_parsed_by_rosidl_field_for_field(self):
        messages = [idl for idl in self.idl_of("jostle_msgs") if idl.parent.name == "msg"]
        for file, idl in zip(self.files, messages, strict=True):
            lines = (line.split("#")[0].split() for line in file.read_text().splitlines())
            fields = [words[1] for words in lines if len(words) > 1 and "=" not in words[1]]
            content = parse_idl_file(IdlLocator(idl.parents[1], pathlib.Path("msg") / idl.name)).content
            (message,) = content.get_elements_of_type(Message)
            self.assertEqual(message.structure.namespaced_type.namespaced_name(), ("jostle_msgs", "msg", file.stem))
            self.assertEqual([member.name for member in message.structure.members], fields, file.name)

    def test_makes_of_the_action_what_goes_over_the_wire(self):
        text = re.sub(r"//.*", "", pathlib.Path(ACTION).read_text())
        ours = {}
        for name, body in re.findall(r"struct (Manipulate_\w+) \{(.*?)\};", text, re.S):
            fields = re.findall(r"([\w:]+) (\w+);", body)
            ours[name] = [("jostle_msgs::action::" + kind if kind.startswith("Manipulate_") else kind, field)
                          for kind, field in fields]
        (idl,) = [idl for idl in self.idl_of("jostle_msgs") if idl.parent.name == "action"]
        content = parse_idl_file(IdlLocator(idl.parents[1], pathlib.Path("action") / idl.name)).content
        (action,) = content.get_elements_of_type(Action)
        services = [action.send_goal_service, action.get_result_service]
        messages = [action.goal, action.result, action.feedback, action.feedback_message]
        for message in messages + [part for one in services for part in (one.request_message, one.response_message)]:
            name = message.structure.namespaced_type.name
            theirs = [(member.type.typename if isinstance(member.type, BasicType)
                       else "::".join(member.type.namespaced_name()), member.name)
                      for member in message.structure.members]
            self.assertEqual(ours.pop(name), theirs, name)
        self.assertEqual(ours, {})

    def test_becomes_cpp_that_compiles(self):
        headers = []
        for package in OTHERS + ["jostle_msgs"]:
            place = self.root / "cpp" / package
            place.mkdir(parents=True)
            files = [f"{idl.parents[1]}:{idl.parent.name}/{idl.name}" for idl in self.idl_of(package)]
            with legacy_generator_arguments_file(package_name=package, interface_files=files, include_paths=[],
                                                 templates_path=TEMPLATES, output_path=place) as arguments:
                generate_cpp(arguments)
            headers += sorted(f"{package}/{header.relative_to(place)}" for header in place.glob("*/*.hpp"))
        user = self.root / "user.cpp"
        user.write_text("".join(f'#include "{header}"\n' for header in headers) + """
jostle_msgs::msg::Goal goal(const jostle_msgs::msg::TaskRun& run) { return run.goal; }
double speed(const jostle_msgs::msg::ObjectStates& states) { return states.objects.at(0).linear.x; }
static_assert(jostle_msgs::msg::GoalResult::SUCCEEDED == 1);
jostle_msgs::msg::Goal goal(const jostle_msgs::action::Manipulate::Impl::SendGoalService::Request& request) {
  return request.goal.goal;
}
static_assert(action_msgs::msg::GoalStatus::STATUS_ABORTED == 6);
""")
        includes = [f"-I{folder}" for folder in sorted(pathlib.Path("/usr/include").glob("ros*")) if folder.is_dir()]
        done = subprocess.run(["c++", "-std=c++17", "-fsyntax-only", f"-I{self.root / 'cpp'}", *includes, str(user)],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr[:4000])


if __name__ == "__main__":
    unittest.main()
