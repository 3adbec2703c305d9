// A trampoline, a soft body of Bullet's, and a finger that presses it from above: another-simulator [SESSION [SECONDS]]
//
// Each step of the simulation tells rt-core where the surface under the finger is, as a plane, and pushes the
// trampoline with what the hand has felt since the last step. rt-core computes the force between two steps by itself.
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>
#include <haptic/haptic.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

namespace {

constexpr btScalar kScale = 10;       // Bullet's metres and newtons per metre and newton of the device
constexpr btScalar kSide = 0.4F;      // half the side of the square, Bullet's metres
constexpr btScalar kMass = 0.5F;      // kg
constexpr btScalar kFinger = 0.1F;    // size of the fingertip, Bullet's metres
constexpr double kStiffness = 300.0;  // N/m
constexpr std::int64_t kStepNs = 2'000'000;
constexpr btScalar kStep = 1e-9F * kStepNs;  // s

/// Closes a handle of the C interface.
struct Close {
    void operator()(haptic_state_reader* states) const { haptic_state_reader_close(states); }
    void operator()(haptic_contact_writer* contacts) const { haptic_contact_writer_close(contacts); }
};

btVector3 vector(const double (&from)[3]) {
    return {static_cast<btScalar>(from[0]), static_cast<btScalar>(from[1]), static_cast<btScalar>(from[2])};
}

void store(const btVector3& from, double (&to)[3]) {
    for (int i = 0; i < 3; ++i) {
        to[i] = from[i];
    }
}

/// The surface under the finger, scene.
struct Surface {
    btVector3 point, normal, velocity;
};

/// Bullet's scene: a square sheet, stretched in a frame through the centre of the device. Bullet's margins suit bodies
/// of about a metre, so lengths and forces are kScale times the device's; masses, times and stiffnesses are the same.
class Trampoline {
  public:
    Trampoline() {
        constexpr int nodes = 21;  // on a side
        world_.getWorldInfo().m_gravity.setZero();
        sheet_ = btSoftBodyHelpers::CreatePatch(world_.getWorldInfo(), btVector3(-kSide, 0, kSide),
                                                btVector3(kSide, 0, kSide), btVector3(-kSide, 0, -kSide),
                                                btVector3(kSide, 0, -kSide), nodes, nodes, 0, true);
        sheet_->setTotalMass(kMass);
        for (int i = 0; i < nodes; ++i) {
            for (const int border : {i, nodes * (nodes - 1) + i, nodes * i, nodes * i + nodes - 1}) {
                sheet_->setMass(border, 0);  // fixed to the frame
            }
        }
        for (int i = 0; i < sheet_->m_links.size(); ++i) {
            sheet_->m_links[i].m_rl *= 0.7F;  // stretched
        }
        sheet_->updateLinkConstants();
        sheet_->m_cfg.kDP = 0.1F;  // part of the velocity that a step takes
        sheet_->m_cfg.piterations = 10;
        world_.addSoftBody(sheet_);
        weights_.resize(static_cast<std::size_t>(sheet_->m_nodes.size()));
    }
    ~Trampoline() {
        world_.removeSoftBody(sheet_);
        delete sheet_;
    }
    Trampoline(const Trampoline&) = delete;
    Trampoline& operator=(const Trampoline&) = delete;

    /// Advances one step with a force on the surface under the finger.
    void step(const btVector3& force) {
        for (int i = 0; i < sheet_->m_nodes.size(); ++i) {
            sheet_->addForce(weights_[static_cast<std::size_t>(i)] * force, i);
        }
        world_.stepSimulation(kStep, 0);
    }

    /// Finds the surface under the finger, or the frame if the finger is beyond it.
    Surface under(const btVector3& finger) {
        const btScalar inside = 0.9F * kSide;
        const btVector3 column(btClamped(finger.x(), -inside, inside), 0, btClamped(finger.z(), -inside, inside));
        const btVector3 above = column + btVector3(0, kSide, 0);
        const btVector3 below = column - btVector3(0, kSide, 0);
        btSoftBody::sRayCast hit;
        hit.fraction = 1;
        Surface surface;
        surface.point = sheet_->rayTest(above, below, hit) ? above + hit.fraction * (below - above) : column;

        // Its normal and velocity are a mean over the nodes that the fingertip covers, so that they change smoothly.
        btScalar sum = 0;
        for (int i = 0; i < sheet_->m_nodes.size(); ++i) {
            const btScalar distance = (sheet_->m_nodes[i].m_x - surface.point).length() / kFinger;
            weights_[static_cast<std::size_t>(i)] = std::exp(-distance * distance);
            sum += weights_[static_cast<std::size_t>(i)];
        }
        surface.normal.setZero();
        surface.velocity.setZero();
        for (int i = 0; i < sheet_->m_nodes.size(); ++i) {
            btScalar& weight = weights_[static_cast<std::size_t>(i)];
            weight /= sum;
            surface.normal += weight * sheet_->m_nodes[i].m_n;
            surface.velocity += weight * sheet_->m_nodes[i].m_v;
        }
        surface.normal.normalize();
        if (surface.normal.y() < 0) {
            surface.normal = -surface.normal;
        }
        return surface;
    }

  private:
    btSoftBodyRigidBodyCollisionConfiguration configuration_;
    btCollisionDispatcher dispatcher_{&configuration_};
    btDbvtBroadphase broadphase_;
    btSequentialImpulseConstraintSolver solver_;
    btSoftRigidDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_};
    btSoftBody* sheet_ = nullptr;
    std::vector<btScalar> weights_;  // part of the force that a node receives
};

}  // namespace

int main(int argc, char** argv) {
    const char* const session = argc > 1 ? argv[1] : "default";
    const double seconds = argc > 2 ? std::atof(argv[2]) : 30.0;

    const std::unique_ptr<haptic_state_reader, Close> states(haptic_state_reader_open(session));
    const std::unique_ptr<haptic_contact_writer, Close> contacts(haptic_contact_writer_open(session));
    if (!states || !contacts) {
        std::fprintf(stderr, "another-simulator: %s\n", haptic_last_error());
        return 1;
    }
    const auto frame = std::make_unique<haptic_contact_frame>();
    frame->step_ns = kStepNs;
    frame->stiffness = kStiffness;
    frame->proxy_count = 1;
    haptic_proxy& proxy = frame->proxies[0];
    proxy.plane_count = 1;

    Trampoline trampoline;
    Surface surface = trampoline.under(btVector3(0, kScale, 0));
    haptic_device_state state{};
    const auto start = std::chrono::steady_clock::now();
    const auto steps = static_cast<int>(1e9 * seconds / kStepNs);
    for (int step = 0; step < steps; ++step) {
        // What the hand has felt since the last step acts on the trampoline, in the opposite direction. The impulse
        // counts from the start of rt-core, which may have been started again.
        const haptic_device_state before = state;
        btVector3 felt(0, 0, 0);  // N
        if (haptic_state_reader_read(states.get(), &state) == 1) {
            frame->state_sequence = state.sequence;
            frame->state_time_ns = state.latch_time_ns;
            if (state.session == before.session) {
                felt = (vector(state.impulse) - vector(before.impulse)) / kStep;
            }
        }
        trampoline.step(-kScale * felt);
        // The trampoline can give the hand no more energy than its surface has given to the coupling.
        frame->body_work += felt.dot(surface.velocity / kScale) * kStep;

        // The plane of the surface, in metres of the device.
        const btVector3 hand = vector(state.position);
        surface = trampoline.under(kScale * hand);
        haptic_plane& plane = proxy.planes[0];
        store(surface.normal, plane.normal);
        plane.offset = surface.normal.dot(surface.point) / kScale;
        plane.velocity = surface.normal.dot(surface.velocity) / kScale;
        const btScalar depth = std::fmax(btScalar(0), static_cast<btScalar>(plane.offset) - surface.normal.dot(hand));
        proxy.in_contact = depth > 0 ? HAPTIC_PROXY_TOUCHES : 0;
        store(hand + depth * surface.normal, proxy.position);
        frame->plane_time_ns = haptic_now_ns();
        if (haptic_contact_writer_publish(contacts.get(), frame.get(), haptic_now_ns()) == 0) {
            std::fprintf(stderr, "another-simulator: %s\n", haptic_last_error());
            return 1;
        }
        if (step % 250 == 0) {
            std::printf("surface at %+.2f mm, hand %.2f mm deep: %.3f N felt\n", 1e3 * plane.offset, 1e3 * depth,
                        vector(state.force).length());
            std::fflush(stdout);
        }
        std::this_thread::sleep_until(start + std::chrono::nanoseconds(kStepNs) * (step + 1));
    }
    return 0;
}
