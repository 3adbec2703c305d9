// Contact geometry: one query, one triangle of a cloth frame, the tree, and each move of the proxy.
// Reference figures: refit 3.2 us and query 0.9 us for 4,096 triangles, 25 ns a triangle of a cloth frame, 200 ns a
// random query. The thesis reports 300 to 1,000 us for the work of refit_and_secure.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "contact/contact_candidates.hpp"
#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/speculative_planes.hpp"
#include "contact/swept_tree.hpp"
#include "contact/thesis/thesis_ccd.hpp"
#include "contact/triangle_ccd.hpp"
#include "contact/verification.hpp"
#include "contact/virtual_proxy.hpp"
#include "haptic/sim/fish.hpp"
#include "haptic/sim/tool_model.hpp"
#include "reproduce/pop_out_table.hpp"
#include "tool/tool_proxies.hpp"
#include "verification/surface_crossings.hpp"

namespace {

using haptic::Vec3;
using namespace haptic::sim;

constexpr double kRadius = 0.03;  // m

/// The cloth of the thesis: 1 m, 33 x 33 vertices, double-faced with 4,096 triangles, half of them in its tree;
/// slightly wavy, falling at 14 m/s.
struct Cloth {
    explicit Cloth(double height, double travel = 0.14) {
        constexpr std::uint32_t kCells = 32;
        for (std::uint32_t i = 0; i <= kCells; ++i) {
            for (std::uint32_t j = 0; j <= kCells; ++j) {
                const double x = i / 32.0 - 0.49;
                const double z = j / 32.0 - 0.51;
                start.emplace_back(x, height + 0.005 * std::sin(9.0 * x) * std::cos(7.0 * z), z);
                end.push_back(start.back() + Vec3(0.002 * z, -travel, 0.001 * x));
            }
        }
        for (std::uint32_t i = 0; i < kCells; ++i) {
            for (std::uint32_t j = 0; j < kCells; ++j) {
                const std::uint32_t a = i * (kCells + 1) + j;
                const std::uint32_t b = a + kCells + 1;
                for (const Triangle& t : {Triangle{a, a + 1, b + 1}, Triangle{a, b + 1, b}}) {
                    triangles.push_back(t);
                    triangles.push_back({t[0], t[2], t[1]});
                }
            }
        }
    }
    [[nodiscard]] SurfaceMotion motion() const { return {start, end, triangles}; }

    std::vector<Vec3> start;
    std::vector<Vec3> end;
    std::vector<Triangle> triangles;
};

double uniform(std::mt19937_64& engine, double half) {
    return half * (static_cast<double>(engine() >> 11) * 0x1.0p-52 - 1.0);
}

Vec3 in_cube(std::mt19937_64& engine, double half) {
    return {uniform(engine, half), uniform(engine, half), uniform(engine, half)};
}

/// Triangles of about the sphere's size that deform while they move about five radii; about 0.8 of them touch.
void random_query(benchmark::State& state) {
    std::mt19937_64 engine(1);
    std::vector<MovingTriangle> queries;
    for (int k = 0; k < 4096; ++k) {
        const Vec3 middle = in_cube(engine, 2.5);
        const Vec3 travel = middle * -1.5 + in_cube(engine, 1.5);
        MovingTriangle q;
        for (auto [from, to] : {std::pair{&q.start.a, &q.end.a}, {&q.start.b, &q.end.b}, {&q.start.c, &q.end.c}}) {
            *from = middle + in_cube(engine, 1.5);
            *to = *from + travel + (state.range(0) != 0 ? in_cube(engine, 2.0) : Vec3(0.0));
        }
        queries.push_back(q);
    }
    std::size_t next = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(sphere_triangle_ccd(Vec3(0.0), 1.0, queries[next]));
        next = (next + 1) % queries.size();
    }
}
BENCHMARK(random_query)->ArgName("deforming")->Arg(0)->Arg(1);

/// Every triangle of a cloth frame without a tree, as in the thesis; time is for the whole frame. items_per_second
/// counts triangles.
void cloth_frame_without_tree(benchmark::State& state) {
    const Cloth cloth(0.09);
    for (auto _ : state) {
        double first = 1.0;
        for (const Triangle& t : cloth.triangles) {
            const MovingTriangle moving{{cloth.start[t[0]], cloth.start[t[1]], cloth.start[t[2]]},
                                        {cloth.end[t[0]], cloth.end[t[1]], cloth.end[t[2]]}};
            const TriangleTouch touch = sphere_triangle_ccd(Vec3(0.0), kRadius, moving, first);
            first = touch.touches ? touch.time : first;
        }
        benchmark::DoNotOptimize(first);
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cloth.triangles.size()));
}
BENCHMARK(cloth_frame_without_tree)->Unit(benchmark::kMicrosecond);

void refit(benchmark::State& state) {
    const Cloth cloth(0.09);
    SweptTree tree(cloth.start, cloth.triangles);
    for (auto _ : state) {
        tree.refit(cloth.motion());
        benchmark::ClobberMemory();
    }
}
BENCHMARK(refit)->Unit(benchmark::kMicrosecond);

/// 0: the cloth comes near but not within reach; 1: it would pass right through.
void refit_and_secure(benchmark::State& state) {
    const Cloth cloth(state.range(0) != 0 ? 0.09 : 0.18);
    SweptTree tree(cloth.start, cloth.triangles);
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    for (auto _ : state) {
        tree.refit(cloth.motion());
        benchmark::DoNotOptimize(secure_position(surfaces, Vec3(0.0), kRadius, {}));
    }
}
BENCHMARK(refit_and_secure)->ArgName("hits")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

/// 0: fast, as above; 1: at rest on the cloth, which moves by 0.1 mm a step.
void secure(benchmark::State& state) {
    const Cloth cloth(state.range(0) != 0 ? -kRadius - 0.0048 : 0.09, state.range(0) != 0 ? -1e-4 : 0.14);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    for (auto _ : state) {
        benchmark::DoNotOptimize(secure_position(surfaces, Vec3(0.0), kRadius, {}));
    }
}
BENCHMARK(secure)->ArgName("resting")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

/// From the secure position back to the device, against the cloth at the end of its step.
void virtual_proxy(benchmark::State& state) {
    const Cloth cloth(0.09);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    const Vec3 secure = secure_position(surfaces, Vec3(0.0), kRadius, {}).position;
    for (auto _ : state) {
        const PopOut popped = pop_out(surfaces, secure, kRadius, {});
        benchmark::DoNotOptimize(move_proxy(surfaces, popped.position, Vec3(0.0), kRadius, 0.01, {}));
    }
}
BENCHMARK(virtual_proxy)->Unit(benchmark::kMicrosecond);

/// A tool of one sphere that a hand slides over a fish, 5 mm deep, with three more fish beside it: 6,800 triangles. 1:
/// the fish are rough. The slowest of its steps is reported too.
void virtual_proxy_on_fish(benchmark::State& state) {
    const TriangleMesh fish = make_fish_mesh({});
    std::vector<std::vector<Vec3>> vertices;
    std::vector<SweptTree> trees;
    std::vector<MovingSurface> surfaces;
    for (int k = 0; k < 4; ++k) {
        vertices.push_back(fish.vertices);
        for (Vec3& v : vertices.back()) {
            v.z += 0.15 * k;
        }
        trees.emplace_back(vertices.back(), fish.triangles);
    }
    for (std::size_t k = 0; k < 4; ++k) {
        surfaces.push_back({{vertices[k], vertices[k], fish.triangles}, &trees[k]});
        trees[k].refit(surfaces[k].motion);
    }
    ToolProxies::Settings settings;
    settings.step = 0.001;
    settings.springs.stiffness = 100.0;
    settings.contact.static_friction = state.range(0) != 0 ? 0.8 : 0.0;
    settings.contact.dynamic_friction = state.range(0) != 0 ? 0.5 : 0.0;
    // Path along its back: down from above until it touches, then 5 mm deeper.
    std::vector<Vec3> goals;
    for (int k = 0; k < 100; ++k) {
        const Vec3 above(-0.1 + 0.002 * k, 0.3, 0.001);
        const Vec3 goal = move_proxy(surfaces, above, above - Vec3(0, 0.3, 0), kRadius, 0.001, {}).position;
        goals.push_back(goal - Vec3(0, 0.005, 0));
    }
    for (auto _ : state) {
        haptic::Pose hand{goals[0] + Vec3(0, 0.1, 0), haptic::Quat(1, 0, 0, 0)};
        ToolProxies tool(one_sphere(kRadius), settings, hand);
        for (const Vec3& goal : goals) {
            hand.position = goal;
            tool.set_goals(hand);
            tool.collect(surfaces);
            (void)tool.find_secure_positions();
            tool.pop_out();
            tool.find_equilibrium();
        }
        benchmark::DoNotOptimize(tool.particles()[0].position);
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(goals.size()));
}
BENCHMARK(virtual_proxy_on_fish)->ArgName("rough")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

/// Figure 4.15 of the thesis: Algorithm 2 for given numbers of triangles in range and of iterations, without the search
/// for them. thesis_ms is the printed value (Intel Core i5-4210U), plain_ms the time of a plain implementation on the
/// class of machine that these figures are compared with.
void thesis_pop_out(benchmark::State& state) {
    const auto triangles = pop_out_table_triangles(static_cast<int>(state.range(0)));
    ContactSettings settings;
    settings.pop_out_limit = static_cast<int>(state.range(1));
    for (auto _ : state) {
        benchmark::DoNotOptimize(pop_out_of_list(triangles, Vec3(0.0), kPopOutTableRadius, settings));
    }
    constexpr std::array<double, 9> kThesis{0.01, 0.134, 0.989, 0.018, 0.166, 1.533, 0.028, 0.269, 2.234};
    constexpr std::array<double, 9> kPlain{0.001, 0.018, 0.056, 0.002, 0.014, 0.238, 0.002, 0.021, 0.189};
    const auto column = state.range(1) == 10 ? 0 : state.range(1) == 100 ? 1 : 2;
    const auto figure = static_cast<std::size_t>(3 * (state.range(0) / 10 - 1) + column);
    state.counters["thesis_ms"] = kThesis[figure];
    state.counters["plain_ms"] = kPlain[figure];
}
BENCHMARK(thesis_pop_out)
    ->ArgNames({"triangles", "iterations"})
    ->ArgsProduct({{10, 20, 30}, {10, 100, 1000}})
    ->Unit(benchmark::kMillisecond);

/// Both methods in a fan 3 m deep, from where the proxy has two thirds of its room; 1 is the thesis' method.
void pop_out_of_a_fan(benchmark::State& state) {
    std::vector<Vec3> vertices{{0.0, -3.0, 0.0}};
    std::vector<Triangle> triangles;
    for (std::uint32_t k = 0; k < 32; ++k) {
        vertices.emplace_back(4.0 * std::cos(k * M_PI / 16), 0.0, 4.0 * std::sin(k * M_PI / 16));
        triangles.push_back({0, 1 + (k + 1) % 32, 1 + k});
    }
    SweptTree tree(vertices, triangles);
    const std::array<MovingSurface, 1> surfaces{MovingSurface{{vertices, vertices, triangles}, &tree}};
    tree.refit(surfaces[0].motion);
    ContactSettings settings;
    settings.pop_out = state.range(0) != 0 ? PopOutMethod::Thesis : PopOutMethod::OrderFree;
    const Vec3 start(0.001, -3.0 + kRadius * 2.0 / 3.0, 0.002);
    for (auto _ : state) {
        benchmark::DoNotOptimize(pop_out(surfaces, start, kRadius, settings));
    }
    state.counters["iterations"] = pop_out(surfaces, start, kRadius, settings).iterations;
}
BENCHMARK(pop_out_of_a_fan)->ArgName("thesis")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void speculative_planes(benchmark::State& state) {
    const Cloth cloth(0.18);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    for (auto _ : state) {
        benchmark::DoNotOptimize(
            speculative_planes(surfaces, {}, {.position = Vec3(0.0), .radius = kRadius, .reach = 0.01, .dt = 0.01}));
    }
}
BENCHMARK(speculative_planes)->Unit(benchmark::kMicrosecond);

/// A floor of triangles as large as the cloth's, in a square that grows with their number. All but about forty are far
/// away from the sphere that rests on it.
struct Floor {
    explicit Floor(std::int64_t about) {
        const auto cells = static_cast<std::uint32_t>(std::lround(std::sqrt(static_cast<double>(about) / 2.0)));
        for (std::uint32_t i = 0; i <= cells; ++i) {
            for (std::uint32_t j = 0; j <= cells; ++j) {
                const double x = (i - 0.5 * cells) / 32.0;
                const double z = (j - 0.5 * cells) / 32.0;
                start.emplace_back(x, -0.001 * (x * x + z * z) / (1.0 + x * x + z * z), z);
                end.push_back(start.back() + Vec3(0.0, 1e-4, 0.0));
            }
        }
        for (std::uint32_t i = 0; i < cells; ++i) {
            for (std::uint32_t j = 0; j < cells; ++j) {
                const std::uint32_t a = i * (cells + 1) + j;
                const std::uint32_t b = a + cells + 1;
                triangles.push_back({a, a + 1, b + 1});
                triangles.push_back({a, b + 1, b});
            }
        }
    }
    [[nodiscard]] SurfaceMotion motion() const { return {start, end, triangles}; }

    std::vector<Vec3> start;
    std::vector<Vec3> end;
    std::vector<Triangle> triangles;
};

/// Steps of one proxy among 4,096 triangles, as a tool takes them: candidates, pop-out, proxy, planes.
class ProxyAmong4096 {
  public:
    explicit ProxyAmong4096(std::span<const MovingSurface> surfaces) : surfaces_(surfaces) {}

    /// One step from `from` toward `goal`; returns where it ends. `reach` is that of the speculative planes; 0: none.
    Vec3 step(const Vec3& from, const Vec3& goal, double reach) {
        const std::array<ProxyReach, 1> proxy{ProxyReach{from, goal, kRadius}};
        candidates_.collect(surfaces_, proxy);
        const NearSurfaces near = candidates_.of(0);
        const PopOut popped = pop_out(near, from, kRadius, {});
        const ProxyMove moved = move_proxy(near, popped.position, goal, kRadius, 0.001, {});
        if (reach > 0.0) {
            benchmark::DoNotOptimize(speculative_planes(
                near, moved.contacts, {.position = moved.position, .radius = kRadius, .reach = reach, .dt = 0.001}));
        }
        return moved.position;
    }

  private:
    std::span<const MovingSurface> surfaces_;
    ContactCandidates candidates_{1};
};

constexpr double kPlaneReach = 0.01;  // m

/// A hand moves by 2 mm a step across a floor, without friction. 0: in free air, 5 mm above; 1: in contact, with the
/// goal 10 mm below the surface; 2: the same with speculative planes.
void proxy_on_a_floor(benchmark::State& state) {
    const Floor floor(4096);
    SweptTree tree(floor.start, floor.triangles);
    tree.refit(floor.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{floor.motion(), &tree}};
    ProxyAmong4096 proxy(surfaces);
    constexpr std::size_t kSteps = 200;
    const double height = kRadius + (state.range(0) == 0 ? 0.005 : -0.01);
    // A straight path, oblique to the edges, there and back.
    std::vector<Vec3> goals;
    for (std::size_t k = 0; k < 2 * kSteps; ++k) {
        const double along = 0.002 * (static_cast<double>(std::min(k, 2 * kSteps - k)) - 0.5 * kSteps);
        goals.emplace_back(along, height, 0.37 * along);
    }
    Vec3 at = goals[0] + Vec3(0.0, state.range(0) == 0 ? 0.0 : 0.01, 0.0);
    std::size_t step = 0;
    for (auto _ : state) {
        at = proxy.step(at, goals[step], state.range(0) == 2 ? kPlaneReach : 0.0);
        step = (step + 1) % goals.size();
    }
    benchmark::DoNotOptimize(at);
}
BENCHMARK(proxy_on_a_floor)->ArgName("case")->DenseRange(0, 2)->Unit(benchmark::kMicrosecond);

/// The double-faced cloth at rest on the proxy, from which the proxy goes back to a goal 10 mm inside; cases as above.
void proxy_under_a_cloth(benchmark::State& state) {
    const Cloth cloth(state.range(0) == 0 ? -0.05 : 0.025, 1e-4);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    ProxyAmong4096 proxy(surfaces);
    for (auto _ : state) {
        const Vec3 from(0.0, state.range(0) == 0 ? 0.05 : -0.005, 0.0);
        const Vec3 goal(0.001, state.range(0) == 0 ? 0.05 : 0.01, 0.0005);
        benchmark::DoNotOptimize(proxy.step(from, goal, state.range(0) == 2 ? kPlaneReach : 0.0));
    }
}
BENCHMARK(proxy_under_a_cloth)->ArgName("case")->DenseRange(0, 2)->Unit(benchmark::kMicrosecond);

/// The proxy of virtual_proxy with its planes. 0: the cloth passes out of reach; 1: proxy; 2: with speculative planes.
void virtual_proxy_by_trees(benchmark::State& state) {
    const Cloth cloth(state.range(0) == 0 ? 0.3 : 0.09);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    const Vec3 secure = secure_position(surfaces, Vec3(0.0), kRadius, {}).position;
    const Vec3 goal(0.001, 0.0, 0.0);
    for (auto _ : state) {
        const PopOut popped = pop_out(surfaces, secure, kRadius, {});
        const ProxyMove moved = move_proxy(surfaces, popped.position, goal, kRadius, 0.01, {});
        benchmark::DoNotOptimize(moved.position);
        if (state.range(0) == 2) {
            benchmark::DoNotOptimize(
                speculative_planes(surfaces, moved.contacts,
                                   {.position = moved.position, .radius = kRadius, .reach = kPlaneReach, .dt = 0.01}));
        }
    }
}
BENCHMARK(virtual_proxy_by_trees)->ArgName("case")->DenseRange(0, 2)->Unit(benchmark::kMicrosecond);

void sizes(benchmark::internal::Benchmark* b) {
    b->ArgName("triangles")->RangeMultiplier(4)->Range(1 << 10, 1 << 20)->Unit(benchmark::kMicrosecond);
}

/// All contact queries of a step without the refit: near-logarithmic in the number of triangles.
void contact_step_among(benchmark::State& state) {
    const Floor floor(state.range(0));
    SweptTree tree(floor.start, floor.triangles);
    tree.refit(floor.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{floor.motion(), &tree}};
    const Vec3 resting(0.011, kRadius, 0.007);
    for (auto _ : state) {
        const SecurePosition secure = secure_position(surfaces, resting, kRadius, {});
        const PopOut popped = pop_out(surfaces, secure.position, kRadius, {});
        const ProxyMove moved = move_proxy(surfaces, popped.position, resting - Vec3(0, 0.01, 0), kRadius, 0.01, {});
        benchmark::DoNotOptimize(speculative_planes(
            surfaces, moved.contacts, {.position = moved.position, .radius = kRadius, .reach = 0.01, .dt = 0.01}));
    }
}
BENCHMARK(contact_step_among)->Apply(sizes);

/// Refit of as many triangles, each step if they move; items_per_second counts triangles.
void refit_of(benchmark::State& state) {
    const Floor floor(state.range(0));
    SweptTree tree(floor.start, floor.triangles);
    for (auto _ : state) {
        tree.refit(floor.motion());
        benchmark::ClobberMemory();
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(floor.triangles.size()));
}
BENCHMARK(refit_of)->Apply(sizes);

/// As many triangles, cut into 1, 8, ... bodies of 128 triangles far away, and the cloth: the cost of each further
/// body.
void secure_among_bodies(benchmark::State& state) {
    const Cloth cloth(-kRadius - 0.0048, -1e-4);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    Floor far(128);
    for (std::vector<Vec3>* vertices : {&far.start, &far.end}) {
        for (Vec3& v : *vertices) {
            v.y += 10.0;
        }
    }
    SweptTree far_tree(far.start, far.triangles);
    far_tree.refit(far.motion());
    std::vector<MovingSurface> surfaces(static_cast<std::size_t>(state.range(0)),
                                        MovingSurface{far.motion(), &far_tree});
    surfaces.push_back({cloth.motion(), &tree});
    for (auto _ : state) {
        benchmark::DoNotOptimize(secure_position(surfaces, Vec3(0.0), kRadius, {}));
    }
}
BENCHMARK(secure_among_bodies)->ArgName("far")->Arg(0)->Arg(8)->Arg(64)->Arg(512)->Unit(benchmark::kMicrosecond);

/// Corners and centre on integers, a radius of 1e-9 of them, as in the tests against exact arithmetic.
void vanishing_sphere(benchmark::State& state) {
    std::mt19937_64 engine(52);
    const auto on_grid = [&] {
        const Vec3 v = in_cube(engine, 100.0);
        return Vec3(std::round(v.x), std::round(v.y), std::round(v.z));
    };
    std::vector<MovingTriangle> queries(4096);
    double maximum = 0.0;
    double all = 0.0;
    for (MovingTriangle& q : queries) {
        for (Vec3* corner : {&q.start.a, &q.start.b, &q.start.c, &q.end.a, &q.end.b, &q.end.c}) {
            *corner = on_grid();
        }
        const int looks = sphere_triangle_ccd(Vec3(0.0), 1e-9, q).iterations;
        maximum = std::max<double>(maximum, looks);
        all += looks;
    }
    std::size_t next = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(sphere_triangle_ccd(Vec3(0.0), 1e-9, queries[next]));
        next = (next + 1) % queries.size();
    }
    state.counters["looks_mean"] = all / static_cast<double>(queries.size());
    state.counters["looks_most"] = maximum;
}
BENCHMARK(vanishing_sphere);

/// Algorithm 1 of the thesis over the tree, on the frame of refit_and_secure; and over all triangles, as in the thesis.
void thesis_secure(benchmark::State& state) {
    const Cloth cloth(0.09);
    SweptTree tree(cloth.start, cloth.triangles, Faces::All);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    ContactSettings settings;
    settings.method = CcdMethod::Thesis;
    for (auto _ : state) {
        benchmark::DoNotOptimize(secure_position(surfaces, Vec3(0.0), kRadius, settings));
    }
}
BENCHMARK(thesis_secure)->Unit(benchmark::kMicrosecond);

/// items_per_second counts triangles.
void thesis_without_tree(benchmark::State& state) {
    const Cloth cloth(0.09);
    for (auto _ : state) {
        for (const Triangle& t : cloth.triangles) {
            const MovingTriangle moving{{cloth.start[t[0]], cloth.start[t[1]], cloth.start[t[2]]},
                                        {cloth.end[t[0]], cloth.end[t[1]], cloth.end[t[2]]}};
            benchmark::DoNotOptimize(thesis_triangle_ccd(Vec3(0.0), kRadius, moving));
        }
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cloth.triangles.size()));
}
BENCHMARK(thesis_without_tree)->Unit(benchmark::kMicrosecond);

/// Cost of --verify a step.
void verification(benchmark::State& state) {
    const Cloth cloth(0.09);
    SweptTree tree(cloth.start, cloth.triangles);
    tree.refit(cloth.motion());
    const std::array<MovingSurface, 1> surfaces{MovingSurface{cloth.motion(), &tree}};
    const std::array<SurfaceMotion, 1> motions{cloth.motion()};
    ProxyPath path;
    path.restart(Vec3(0.0));
    const Vec3 secure = secure_position(surfaces, Vec3(0.0), kRadius, {}, &path).position;
    benchmark::DoNotOptimize(move_proxy(surfaces, secure, Vec3(0.0), kRadius, 0.01, {}, &path));
    for (auto _ : state) {
        benchmark::DoNotOptimize(find_crossings(motions, path.knots()));
    }
}
BENCHMARK(verification)->Unit(benchmark::kMicrosecond);

/// Cost of --verify a step for the cloth's crossings with itself.
void surface_crossings(benchmark::State& state) {
    const Cloth cloth(0.09);
    const CheckedSurface surface{cloth.triangles, 0};
    SurfaceCrossings finder({&surface, 1}, cloth.start);
    for (auto _ : state) {
        benchmark::DoNotOptimize(finder.find(cloth.end, rounding_of(cloth.end)).size());
    }
}
BENCHMARK(surface_crossings)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
