#!/usr/bin/env python3
"""Plants each kind of missing include in a small tree and expects check_self_contained.py to name it, and no more than that."""
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True  # nothing is written to the source tree
from check_self_contained import INCLUDE_DIRECTORIES, check

FILES = {
    "shared/include/haptic/types.hpp": "#pragma once\n#include <glm/gtc/quaternion.hpp>\n"
                                       "namespace haptic {\nusing Vec3 = glm::dvec3;\ninline constexpr int kStrings = 8;\n}\n",
    "shared/include/haptic/realtime.hpp": "#pragma once\n#define HAPTIC_RT noexcept\n",
    "host-sim/src/mesh/box.hpp": '#pragma once\n#include <vector>\n#include "haptic/types.hpp"\nnamespace haptic::sim {\n'
                                 "struct Box {\n    Vec3 low;\n    int inner_size(int scale = {}) const;\n};\n"
                                 "[[nodiscard]] std::vector<Vec3> corners_of(const Box& box);\n}\n",
    "host-sim/src/scene/scene.hpp": "#pragma once\nnamespace CLI {\nclass App;\n}\nnamespace haptic::sim {\nstruct Box;\n"
                                    "enum class Kind { Free, Fixed };\nvoid add(const Box& box, CLI::App& app);\n}\n",
}
SOURCE = "host-sim/src/scene/scene.cpp"


class CheckSelfContained(unittest.TestCase):
    def problems(self, text: str, path: str = SOURCE) -> list[str]:
        with tempfile.TemporaryDirectory() as folder:
            for name, content in {**FILES, path: text}.items():
                file = Path(folder) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(content)
            return check(Path(folder), list(INCLUDE_DIRECTORIES))

    def test_accepts_what_a_header_of_the_project_includes(self):
        self.assertEqual(self.problems('#include "mesh/box.hpp"\nstd::vector<haptic::Vec3> all(haptic::kStrings);\n'), [])

    def test_finds_a_name_of_the_standard_library(self):
        self.assertEqual(self.problems("#include <string>\n\nstd::vector<std::string> names;\n"),
                         [f"{SOURCE}:3: std::vector needs #include <vector>"])
        self.assertEqual(self.problems("void f() { std::ranges::sort(a); }\n"), [f"{SOURCE}:1: std::sort needs #include <algorithm>"])

    def test_accepts_each_header_that_promises_a_name(self):
        for header in ("cmath", "cstdlib"):
            self.assertEqual(self.problems(f"#include <{header}>\nint a = std::abs(-1);\n"), [])

    def test_finds_names_of_glm_posix_and_other_libraries(self):
        self.assertEqual(self.problems("double d = glm::dot(a, b);\n"),
                         [f"{SOURCE}:1: glm::dot needs #include <glm/geometric.hpp>"])
        self.assertEqual(self.problems("bool f() { return errno == EINTR; }\n"),
                         [f"{SOURCE}:1: errno needs #include <cerrno>", f"{SOURCE}:1: EINTR needs #include <cerrno>"])
        self.assertEqual(self.problems("void f() { ::close(3); }\n"), [f"{SOURCE}:1: close needs #include <unistd.h>"])
        self.assertEqual(self.problems("nlohmann::json report;\n"), [f"{SOURCE}:1: nlohmann:: needs #include <nlohmann/json.hpp>"])

    def test_takes_a_member_or_a_local_name_for_no_function_of_posix(self):
        self.assertEqual(self.problems("struct File { void close(); void end() { close(); } };\nvoid f(File& a) { a.close(); }\n"), [])
        self.assertEqual(self.problems("void f() {\n    const auto write = [] {};\n    write();\n}\n"), [])

    def test_finds_types_constants_functions_and_macros_of_the_project(self):
        self.assertEqual(self.problems("void f(const Vec3& v);\n"), [f'{SOURCE}:1: Vec3 needs #include "haptic/types.hpp"'])
        self.assertEqual(self.problems("[[nodiscard]] Vec3 f();\n"), [f'{SOURCE}:1: Vec3 needs #include "haptic/types.hpp"'])
        self.assertEqual(self.problems("int n = haptic::kStrings;\n"), [f'{SOURCE}:1: kStrings needs #include "haptic/types.hpp"'])
        self.assertEqual(self.problems("void f() { sim::corners_of({}); }\n"), [f'{SOURCE}:1: corners_of needs #include "mesh/box.hpp"'])
        self.assertEqual(self.problems("void f() HAPTIC_RT;\n"), [f'{SOURCE}:1: HAPTIC_RT needs #include "haptic/realtime.hpp"'])

    def test_finds_what_a_header_leaves_to_those_that_include_it(self):
        header = "host-sim/src/scene/load.hpp"
        self.assertEqual(self.problems("struct Load {\n    Vec3 force;\n};\n", header),
                         [f'{header}:2: Vec3 needs #include "haptic/types.hpp"'])

    def test_accepts_a_name_that_is_declared_otherwise(self):
        self.assertEqual(self.problems("template <class Vec3>\nVec3 twice(Vec3 v);\n"), [])
        self.assertEqual(self.problems("enum class Part { Box, Rod };\nPart f() { return Part::Box; }\n"), [])
        self.assertEqual(self.problems("constexpr int kStrings = 2;\nint n = kStrings;\n"), [])
        self.assertEqual(self.problems("int other::Vec3::size = Other::Vec3();\n"), [])
        self.assertEqual(self.problems("void f() { inner_size(2); }\n"), [])  # a member function is no name of its header

    def test_accepts_a_forward_declaration_until_the_type_must_be_complete(self):
        include = '#include "scene/scene.hpp"\n'
        self.assertEqual(self.problems(include + "void g(const Box& box) {\n    add(box, app);\n}\n"), [])
        self.assertEqual(self.problems(include + "void g(const Box& box) {\n    use(box.low);\n}\n"),
                         [f'{SOURCE}:3: Box needs #include "mesh/box.hpp"'])
        self.assertEqual(self.problems(include + "auto box = Box{};\n"), [f'{SOURCE}:2: Box needs #include "mesh/box.hpp"'])
        self.assertEqual(self.problems(include + "void g(CLI::App& app) {\n    pass(app);\n}\n"), [])
        self.assertEqual(self.problems(include + "void g(CLI::App& app) {\n    app.parse();\n}\n"),
                         [f"{SOURCE}:3: CLI:: needs #include <CLI/CLI.hpp>"])

    def test_reads_neither_comments_nor_literals(self):
        self.assertEqual(self.problems('// std::vector\n/* Vec3\n kStrings */ const char* a = "std::string Vec3";\n'
                                       "int n = 1'000; char c = '\"'; const char* r = R\"(#include\nstd::map)\"; // '\n"), [])
        self.assertEqual(self.problems("/*\n*/ // #include <map>\nstd::map<int, int> m;\n"), [f"{SOURCE}:3: std::map needs #include <map>"])

    def test_looks_up_includes_where_the_folder_can_see_them(self):
        own = "rt-core/src/process/run.cpp"
        self.assertEqual(self.problems("void f(const Box& box);\n", own), [])  # Box is host-sim's, no name of this process
        self.assertEqual(self.problems('#include "mesh/box.hpp"\nstd::vector<int> v;\n', own),
                         [f"{own}:2: std::vector needs #include <vector>"])


if __name__ == "__main__":
    unittest.main()
