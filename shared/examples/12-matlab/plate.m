function plate(name, seconds)
%PLATE  A plate on a spring and a damper, which the hand presses down: plate(SESSION, SECONDS)
    if nargin < 1
        name = 'default';
    end
    if nargin < 2
        seconds = 10;
    end
    mass = 0.2;          % kg
    spring = 125;        % N/m, which holds the plate at y = 0
    damper = 3;          % N s/m
    coupling = 500;      % N/m, between plate and hand

    % One proxy, and the plane that is the plate: its normal points up, out of the surface.
    frame = Haptic.frame(1);
    frame.step_ns = 2e6;
    frame.stiffness = coupling;
    frame.plane_count = 1;
    frame.plane_normal(:, 1) = [0; 1; 0];

    % The session ends with this function, also by an error or Ctrl-C.
    session = Haptic(name);
    state = session.wait(10);
    height = 0;          % m, of the plate
    velocity = 0;        % m/s
    felt = 0;            % N, upward, in the newest state that rendered the plate without fading
    states = 1;
    end_ns = Haptic.now_ns() + int64(1e9 * seconds);
    while Haptic.now_ns() < end_ns
        newest = session.read();
        if ~isempty(newest)
            % The plate moves by the time between the two states, m v' = -k y - d v - F, with the impulse that the hand
            % really felt. Backward Euler: stable however late this loop is.
            step = 1e-9 * double(newest.latch_time_ns - state.latch_time_ns);
            taken = newest.impulse(2) - state.impulse(2);
            velocity = (mass * velocity - step * spring * height - taken) / (mass + step * damper + step^2 * spring);
            height = height + step * velocity;
            state = newest;
            states = states + 1;
            if state.scale == 1
                felt = state.force(2);
            end
        end
        frame.state_sequence = state.sequence;
        frame.state_time_ns = state.latch_time_ns;
        frame.plane_time_ns = state.latch_time_ns;
        frame.plane_offset(1) = height;
        frame.plane_velocity(1) = velocity;
        frame.position = [state.position(1); max(state.position(2), height); state.position(3)];
        frame.in_contact = Haptic.TOUCHES * (state.position(2) < height);
        session.publish(frame);
        pause(0.001);
    end
    fprintf('%.2f N felt at last, %d states read\n', felt, states);
end
