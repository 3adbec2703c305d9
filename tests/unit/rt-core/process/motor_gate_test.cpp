#include "process/motor_gate.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <thread>

#include "haptic/device/emulated_board.hpp"
#include "shared_board.hpp"

namespace haptic::rt {
namespace {

using test::SharedBoard;
using test::SharedMotors;

device::MotorCommand all(std::int16_t dac_code) {
    device::MotorCommand command;
    command.dac_codes.fill(dac_code);
    return command;
}

TEST(MotorGate, PassesCommandsUntilClosedAndZerosThereafter) {
    SharedMotors motors;
    SharedBoard board(motors);
    MotorGate gate(board);
    device::BoardReading reading;
    EXPECT_EQ(gate.exchange(all(100), reading, 0), device::ExchangeStatus::Ok);
    EXPECT_EQ(motors.sum(), 800);
    gate.close();
    EXPECT_EQ(motors.sum(), 0);
    EXPECT_EQ(motors.zeros_sent, 1);
    EXPECT_EQ(gate.exchange(all(100), reading, 1'000'000), device::ExchangeStatus::Ok) << "the encoders are still read";
    EXPECT_EQ(motors.sum(), 0);
}

TEST(MotorGate, PassesCommandsThatAreOnlySentUntilClosedAndZerosThereafter) {
    device::EmulatedBoard board({.geometry = device::spidar_g6_x3r()});
    MotorGate gate(board);
    EXPECT_EQ(gate.send(all(100), 0), device::ExchangeStatus::Ok);
    EXPECT_EQ(board.device().dac_codes()[0], 100);
    EXPECT_TRUE(gate.answer_due());
    EXPECT_EQ(gate.collect(1'000'000), device::ExchangeStatus::Ok);
    EXPECT_FALSE(gate.answer_due());
    gate.close();
    EXPECT_EQ(gate.send(all(100), 2'000'000), device::ExchangeStatus::Ok);
    EXPECT_EQ(board.device().dac_codes()[0], 0);
}

TEST(MotorGate, SendsZerosAgainAfterACommandThatWasUnderWay) {
    // The board applies the command after the gate was closed, so that zero_motors() alone would not leave zeros.
    SharedMotors motors;
    motors.hang = true;
    SharedBoard board(motors);
    MotorGate gate(board);
    std::thread loop([&gate] {
        device::BoardReading reading;
        gate.exchange(all(100), reading, 0);
    });
    while (!motors.hanging) {
        test::sleep_ms(1);
    }
    std::thread release([&motors] {
        while (motors.zeros_sent == 0) {
            test::sleep_ms(1);
        }
        motors.hang = false;
    });
    // close() gives up after its bound; on a slower machine the next call sends the last zeros.
    while (motors.hanging) {
        gate.close();
    }
    release.join();
    loop.join();
    gate.close();
    EXPECT_EQ(motors.sum(), 0);
    EXPECT_GE(motors.zeros_sent, 2);
}

TEST(MotorGate, SendsZerosFromTheMomentOnThatAnotherProcessHasCutIt) {
    SharedMotors motors;
    SharedBoard board(motors);
    MotorGate gate(board);
    std::atomic<std::uint32_t> cut{0};
    gate.obey(cut);
    device::BoardReading reading;
    EXPECT_EQ(gate.exchange(all(100), reading, 0), device::ExchangeStatus::Ok);
    EXPECT_EQ(motors.sum(), 800);
    cut = 1;
    EXPECT_EQ(gate.exchange(all(100), reading, 1'000'000), device::ExchangeStatus::Ok);
    EXPECT_EQ(motors.sum(), 0);
    EXPECT_FALSE(gate.closed());
}

TEST(MotorGate, TakesBackACommandThatWasUnderWayWhenItWasCut) {
    // The process stands still between the look at the flag and the command, and continues after the cut.
    SharedMotors motors;
    motors.hang = true;
    SharedBoard board(motors);
    MotorGate gate(board);
    std::atomic<std::uint32_t> cut{0};
    gate.obey(cut);
    std::thread loop([&gate] {
        device::BoardReading reading;
        gate.exchange(all(100), reading, 0);
    });
    while (!motors.hanging) {
        test::sleep_ms(1);
    }
    cut = 1;
    motors.hang = false;
    loop.join();
    EXPECT_EQ(motors.sum(), 0);
    EXPECT_EQ(motors.zeros_sent, 1);
}

TEST(MotorGate, BoundsItsWaitForABoardThatHangs) {
    SharedMotors motors;
    motors.hang = true;
    SharedBoard board(motors);
    MotorGate gate(board);
    std::thread loop([&gate] {
        device::BoardReading reading;
        gate.exchange(all(100), reading, 0);
    });
    while (!motors.hanging) {
        test::sleep_ms(1);
    }
    gate.close();
    EXPECT_TRUE(motors.hanging);
    EXPECT_EQ(motors.zeros_sent, 2);
    motors.hang = false;
    loop.join();
}

}  // namespace
}  // namespace haptic::rt
