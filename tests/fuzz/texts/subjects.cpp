#include "tests/fuzz/texts/subjects.hpp"

#include <array>
#include <memory>
#include <stdexcept>

#include "idl/files/files.hpp"
#include "physics_pool/coarse/learned/learned_model.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "services/task/config/parameters.hpp"
#include "services/wire/dds/profiles.hpp"
#include "services/wire/security/identity.hpp"
#include "tests/support/forgery.hpp"
#include "tests/support/networks.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;

const fs::path kSources = JOSTLE_SOURCE_DIR;

std::string content_of(const fs::path& file) { return sure(files::read(file)); }

void require(bool holds, const std::string& promise) {
  if (!holds) throw std::runtime_error("broken: " + promise);
}

template <class T>
bool told(const Result<T>& result) {
  require(result || !result.error().message.empty(), "a refusal has words");
  return static_cast<bool>(result);
}

Subject scenes() {
  Subject subject{.name = "scenes", .grammar = Grammar::kYaml, .originals = {}, .read = {}};
  for (const auto& entry : fs::directory_iterator(kSources / "scenes")) {
    if (entry.path().extension() == ".yaml") subject.originals.push_back(content_of(entry.path()));
  }
  std::ranges::sort(subject.originals);
  subject.originals.push_back(to_yaml(sure(physics_pool::generate_chapter3({.objects = 5}))));
  subject.originals.push_back(to_yaml(sure(physics_pool::generate_chapter7({})), physics_pool::RobotText::kByName));
  subject.read = [](const std::string& text) {
    const auto scene_result = physics_pool::parse_scene(text, "scene.yaml");
    if (!told(scene_result)) return false;
    const auto again_result = physics_pool::parse_scene(to_yaml(*scene_result), "again.yaml");
    require(again_result && scene_hash(*again_result) == scene_hash(*scene_result),
            "a scene survives being written and read");
    return true;
  };
  return subject;
}

Subject parameters() {
  Subject subject{.name = "parameters", .grammar = Grammar::kYaml, .originals = {}, .read = {}};
  for (const char* name : {"chapter3.yaml", "grasping.yaml", "pushing.yaml"})
    subject.originals.push_back(content_of(kSources / "experiments" / name));
  subject.read = [](const std::string& text) { return told(task::parse_parameters(text, "parameters.yaml")); };
  return subject;
}

Subject networks() {
  Subject subject{.name = "networks", .grammar = Grammar::kBytes, .originals = {}, .read = {}};
  for (const int width : {1, 12}) subject.originals.push_back(to_file(random_network(width)));
  const auto scene = std::make_shared<physics_pool::Scene>(slider_scene(2));
  subject.read = [scene](const std::string& text) {
    const auto network_result = physics_pool::parse_network(text, "a.net");
    if (!told(network_result)) return false;
    const auto model_result = physics_pool::make_learned_model(*network_result, *scene, "a.net");
    if (!told(model_result)) return true;  // a network, for other scenes
    std::vector<double> state(static_cast<std::size_t>((*model_result)->layout().size()), 0.1);
    (*model_result)->advance(state, std::array{0.05, 0.0}, 1.0);
    return true;
  };
  return subject;
}

Subject profiles(const fs::path& folder) {
  Subject subject{.name = "profiles",
                  .grammar = Grammar::kXml,
                  .originals = {content_of(kSources / "deploy" / "profiles.xml"),
                                "<profiles><data_writer profile_name='rt/clock'><qos><reliability><kind>RELIABLE</kind>"
                                "</reliability></qos></data_writer></profiles>"},
                  .read = {}};
  subject.read = [file = folder / "profiles.xml"](const std::string& text) {
    overwrite(file, text);
    return told(wire::load_profiles({.path = file}));
  };
  return subject;
}

// One text in front of the name of its file, so that each goes where it came from.
Subject keystores(const fs::path& folder) {
  const auto lab = std::make_shared<Lab>(folder / "lab");
  const fs::path identity = lab->issue("arm", wire::Role::kRobot);
  Subject subject{.name = "keystores", .grammar = Grammar::kXml, .originals = {}, .read = {}};
  for (const char* name : {"ca.pem", "cert.pem", "key.pem", "crl.pem", "governance.p7s", "permissions.p7s"})
    subject.originals.push_back(std::string("identities/arm/") + name + "\n" + content_of(identity / name));
  for (const char* name : {"ca.pem", "ca.key", "crl.pem", "index.json"})
    subject.originals.push_back(std::string("ca/") + name + "\n" + content_of(lab->folder() / "ca" / name));
  const wire::Identity issued = sure(wire::open_identity(identity));
  subject.originals.push_back("signed permissions\n" +
                              wire::permissions_text({.subject = issued.subject,
                                                      .validity = {.not_before = 0, .not_after = 4'000'000'000},
                                                      .rights = issued.rights}));
  subject.originals.push_back("signed governance\n" + wire::governance_text());
  subject.read = [lab, identity](const std::string& text) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string name = text.substr(0, end), content = text.substr(std::min(end + 1, text.size()));
    const bool is_signed = name.starts_with("signed ");
    fs::path file = lab->folder() / name;
    if (is_signed) file = identity / (name.substr(7) + ".p7s");
    if (!is_signed && (name.size() > 40 || name.find("..") != name.npos || !fs::is_regular_file(file))) return false;
    if (!fs::is_regular_file(file)) return false;
    const std::string before = content_of(file);
    overwrite(file, is_signed ? lab->signed_by_authority(content) : content);
    const bool opens = told(wire::open_identity(identity));
    const bool lists = told(wire::keystore::list(lab->folder()));
    if (name.starts_with("ca/")) {
      told(wire::keystore::revoke(lab->folder(), "nobody"));
    }
    overwrite(file, before);
    return opens && lists;
  };
  return subject;
}

}  // namespace

std::vector<Subject> make_subjects(const fs::path& folder) {
  std::vector<Subject> subjects;
  subjects.push_back(scenes());
  subjects.push_back(parameters());
  subjects.push_back(networks());
  subjects.push_back(profiles(folder));
  subjects.push_back(keystores(folder));
  return subjects;
}

}  // namespace jostle::tests
