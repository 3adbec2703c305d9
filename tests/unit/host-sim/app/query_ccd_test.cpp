#include "app/query_ccd.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

#include "contact/oracle.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::oracle::Motion;
using haptic::sim::oracle::Query;
using haptic::sim::oracle::Random;

struct Outcome {
    int status = 0;
    std::vector<std::string> answers;
    std::string errors;
};

Outcome run(const std::string& queries) {
    std::istringstream in(queries);
    std::ostringstream out;
    std::ostringstream errors;
    Outcome r;
    r.status = haptic::sim::query_ccd(in, out, errors);
    std::istringstream lines(out.str());
    for (std::string line; std::getline(lines, line);) {
        r.answers.push_back(line);
    }
    r.errors = errors.str();
    return r;
}

std::vector<std::string> fields(const std::string& line) {
    std::vector<std::string> f{""};
    for (const char c : line) {
        if (c == ',') {
            f.emplace_back();
        } else {
            f.back() += c;
        }
    }
    return f;
}

std::string written(const Query& q) {
    std::string line;
    const auto add = [&](double x) {
        char text[40];
        std::snprintf(text, sizeof text, "%s%.17g", line.empty() ? "" : ",", x);
        line += text;
    };
    const auto add3 = [&](const Vec3& v) {
        add(v.x);
        add(v.y);
        add(v.z);
    };
    add3(q.center);
    add(q.radius);
    for (const auto* corners : {&q.start, &q.end}) {
        for (const Vec3& corner : *corners) {
            add3(corner);
        }
    }
    return line;
}

constexpr const char* kFalling = "0,0,0,1,-4,5,-4,4,5,-4,0,5,6,-4,-5,-4,4,-5,-4,0,-5,6";
constexpr const char* kFar = "0,0,0,1,-4,5,-4,4,5,-4,0,5,6,-4,3,-4,4,3,-4,0,3,6";

TEST(QueryCcd, AnswersForAFaceThatFallsThroughTheSphere) {
    const Outcome r = run(std::string(kFalling) + "\n");
    EXPECT_EQ(r.status, 0);
    ASSERT_EQ(r.answers.size(), 1u);
    const auto f = fields(r.answers[0]);
    ASSERT_EQ(f.size(), 9u);
    EXPECT_EQ(f[0], "face");
    EXPECT_NEAR(std::stod(f[1]), 0.4, 1e-12);
    EXPECT_NEAR(std::stod(f[2]), 0.5, 1e-12);
    EXPECT_NEAR(std::stod(f[4]), -1.0, 1e-12);
    EXPECT_NEAR(std::stod(f[6]), 0.0, 1e-12);
    EXPECT_NEAR(std::stod(f[7]), -6.0, 1e-3);  // below the face, which ends at -5
    EXPECT_NEAR(std::stod(f[8]), 0.0, 1e-12);
}

TEST(QueryCcd, LeavesFieldsEmptyAndTheCentreInPlaceWithoutContact) {
    const Outcome r = run(std::string(kFar) + "\n");
    EXPECT_EQ(r.status, 0);
    EXPECT_THAT(r.answers, testing::ElementsAre("none,,,,,,0,0,0"));
}

TEST(QueryCcd, SkipsCommentsAndBlankLinesAndAcceptsSpaces) {
    const Outcome r = run(std::string("# px,py,...\n\n   \n") + kFar + " # a remark\r\n\t" + kFar);
    EXPECT_EQ(r.status, 0);
    EXPECT_EQ(r.answers.size(), 2u);
    EXPECT_EQ(r.errors, "");
}

TEST(QueryCcd, NamesEachMalformedLineAndAnswersTheRest) {
    const std::string far = kFar;
    const std::string rest = far.substr(7);  // from the comma after the radius
    const Outcome r = run(far + "\n1,2,3\n" + far + ",0\n# remark\n0,0,0,-1" + rest + "\n0,0,0,nan" + rest +
                          "\n0,0,zero,1" + rest + "\n" + kFalling + "\n");
    EXPECT_EQ(r.status, 2);
    EXPECT_EQ(r.answers.size(), 2u);
    for (const char* line : {"line 2:", "line 3:", "line 5:", "line 6:", "line 7:"}) {
        EXPECT_THAT(r.errors, testing::HasSubstr(line));
    }
    EXPECT_THAT(r.errors, testing::Not(testing::HasSubstr("line 8:")));
}

TEST(QueryCcd, TheSecurePositionIsClearOfTheTriangleAndOnTheSameSide) {
    Random random(21);
    int moved = 0;
    for (int k = 0; k < 400; ++k) {
        const Query q = haptic::sim::oracle::random_query(random, static_cast<Motion>(k % 5), 1.0);
        if (haptic::sim::oracle::distance(q.center, q.start) < q.radius) {
            continue;
        }
        const Outcome r = run(written(q) + "\n");
        ASSERT_EQ(r.status, 0) << r.errors;
        const auto f = fields(r.answers.at(0));
        const Vec3 safe(std::stod(f[6]), std::stod(f[7]), std::stod(f[8]));
        EXPECT_GE(haptic::sim::oracle::distance(safe, q.end), q.radius * 0.999) << "query " << k;
        if (f[0] == "none") {
            EXPECT_EQ(safe, q.center);
            continue;
        }
        moved += safe != q.center ? 1 : 0;
        const Vec3 n(std::stod(f[3]), std::stod(f[4]), std::stod(f[5]));
        EXPECT_NEAR(glm::length(n), 1.0, 1e-9);
        if (!f[2].empty()) {
            EXPECT_GE(std::stod(f[2]), std::stod(f[1]));
        }
    }
    EXPECT_GT(moved, 100);
}

}  // namespace
