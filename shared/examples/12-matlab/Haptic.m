classdef Haptic < handle
%HAPTIC  A simulation's session with rt-core, which renders contact planes on a haptic device.
%
%   session = Haptic('default');            % or rt-core run --session NAME; either may start first
%   state = session.wait(10);               % until the device answers, at most 10 s
%   frame = Haptic.frame(1);                % one proxy, no contact yet
%   frame.step_ns = 2e6;                    % the next frame follows in 2 ms
%   frame.stiffness = 500;                  % N/m
%   frame.plane_normal(:, 1) = [0; 1; 0];   % a floor at y = 0
%   frame.plane_count = 1;
%   while true
%       newest = session.read();            % [] if there is none newer
%       if ~isempty(newest)
%           state = newest;
%       end
%       frame.state_sequence = state.sequence;
%       frame.state_time_ns = state.latch_time_ns;
%       frame.plane_time_ns = Haptic.now_ns();
%       frame.position = [state.position(1); max(state.position(2), 0); state.position(3)];
%       frame.in_contact = state.position(2) < 0;
%       session.publish(frame);
%       pause(0.001);
%   end
%
%   Methods of a session:      wait, read, publish, beat, peer, close
%   Methods of an observer:    states, frames, close; made by Haptic(name, 'observe')
%   Functions:                 Haptic.frame, Haptic.now_ns, Haptic.describe
%
%   All is SI. The device frame is right-handed, its origin the centre of the device, x to the right, y up, z to the
%   person. The grip frame is fixed to the grip. Quaternions are [w; x; y; z]. Times are int64 nanoseconds of
%   CLOCK_MONOTONIC, the clock of Haptic.now_ns. N is the number of proxies, the spheres of the tool, 0 to 64.
%
%   A device state is a structure of
%     sequence         uint64   1, 2, 3, ...
%     session          uint64   of the process of the device, a new value each time
%     latch_time_ns    int64    when the encoders were latched
%     frame_sequence   uint64   of the contact frame that was rendered; 0: none
%     position         3 x 1    m, of the grip
%     orientation      4 x 1    device_from_grip
%     linear_velocity  3 x 1    m/s
%     angular_velocity 3 x 1    rad/s
%     force            3 x 1    N, exerted by the strings
%     torque           3 x 1    N m, as above
%     proxy_position   3 x 1    m, local proxy of the first particle
%     tension          8 x 1    N, sent to the motors
%     stiffness        1 x 1    N/m, of the coupling after all limits
%     scale            1 x 1    0 to 1, part of the frame's wrench that is rendered
%     impulse          3 x 1    N s, of the force due to frames since rt-core started
%     angular_impulse  3 x 1    N m s, of the torque
%     safety_state, faults, tick_flags   uint32; Haptic.describe names their bits
%     buttons          uint32   bitget(state.buttons, k + 1) is 1 while button k is pressed, k = 0, 1, ...
%
%   A contact frame is a structure of
%     state_sequence   1 x 1    of the device state that it answers; 0: none
%     state_time_ns    1 x 1    latch_time_ns of that state
%     plane_time_ns    1 x 1    when the planes' offsets hold
%     step_ns          1 x 1    until the next frame, 1 ns to 1 s
%     stiffness        1 x 1    N/m, of the coupling as felt at the hand
%     torque_stiffness 1 x 1    N/m, of a limp tool; 0: same as stiffness
%     static_friction  1 x 1    coefficient up to which a proxy sticks; 0: no friction
%     dynamic_friction 1 x 1    coefficient while it slides, at most static_friction
%     body_work        1 x 1    J at the hand, done by the surfaces on the tool over the session; 0: not known
%     flags            1 x 1    sum of Haptic.SQUEEZED, CLUTCHED, HOLD_POSITIONS
%     rest_offset      3 x N    m, grip frame, where a proxy is without contact; 0 for a tool of one sphere
%     rest_velocity    3 x N    m/s, grip frame, of rest_offset
%     radius           1 x N    m, 0 to 10, of a sphere that turns with the grip: friction acts this much off its
%                               centre, where it touches its first plane; 0: friction acts at the centre
%     position         3 x N    m, where a proxy is at plane_time_ns
%     surface_velocity 3 x N    m/s, of the touched surface, with friction
%     in_contact       1 x N    sum of Haptic.TOUCHES, STICKS, TANGENTS; 0: no contact
%     plane_count      1 x N    0 to 3
%     plane_normal     3 x 3 x N  plane_normal(:, p, i) is the unit normal of plane p of proxy i, out of the surface
%     plane_offset     3 x N    m; allowed is dot(normal, x) >= offset for a proxy's centre x
%     plane_velocity   3 x N    m/s, of the surface along its normal
%     compliance       R x R    symmetric, of R planes and tangents of an elastic tool; its lower triangle is read;
%                               []: a limp tool
%   Its numbers are double; integers of it may also be int64, uint64, uint32 or logical. One that was observed has
%   sequence, session and publish_time_ns, too, which publish replaces.
%
%   Errors have the identifiers haptic:notLoaded (haptic_mex or libhaptic), haptic:notOpened (the name, or another
%   simulation in the session), haptic:closed, haptic:timeout, haptic:invalidFrame, haptic:invalidArgument,
%   haptic:notObserved, haptic:wrongKind.
%
%   The session ends, and the force fades at once, with close, delete, clear, the end of the function that has it, an
%   error there, and the end of MATLAB. haptic.h and frames.h say more about each function and field.

    properties (Constant)
        TOUCHES = 1;            % bits of in_contact
        STICKS = 2;             % static friction: the position moves with surface_velocity
        TANGENTS = 4;           % compliance has two tangential rows for this proxy
        SQUEEZED = 1;           % bits of flags: a proxy is overconstrained
        CLUTCHED = 2;           % the grip is decoupled from the scene: no force
        HOLD_POSITIONS = 8;     % proxies in contact are fixed at position, and planes are ignored
        DISARMED = 0;           % values of safety_state: zero to all motors
        TENSIONING = 1;
        CALIBRATING = 2;
        RUNNING = 3;            % forces are rendered
        FAULTED = 4;
        PROVING = 5;
    end

    properties (SetAccess = private)
        name = '';              % of the session
    end

    properties (Access = private, Transient)
        id = uint64(0);         % of haptic_mex; 0: closed
    end

    methods
        function self = Haptic(name, role)
        %HAPTIC  Joins a session as its simulation, or with Haptic(name, 'observe') as one that only looks.
        %
        %   A name is text of 1 to 64 of the characters A-Z a-z 0-9 _ -. A session has one simulation and any number of
        %   observers, which may come before it and which it does not notice.
            if nargin < 1
                name = 'default';
            end
            observes = nargin == 2;
            if observes && ~strcmp(role, 'observe')
                error('haptic:invalidArgument', 'Haptic: the second argument can only be ''observe''');
            end
            if ~(ischar(name) || isstring(name))
                error('haptic:invalidArgument', 'Haptic: the name of a session is text, and not a %s', class(name));
            end
            self.name = char(name);
            % The id comes first: a Ctrl-C after the call that opens would lose one that the call returned.
            self.id = Haptic.gateway('new_id');
            if observes
                Haptic.gateway('observe', self.id, self.name);
            else
                Haptic.gateway('open', self.id, self.name);
            end
        end

        function delete(self)
        %DELETE  Closes; called by clear, and when the last reference ends.
            close(self);
        end

        function close(self)
        %CLOSE  Detaches. rt-core knows at once, and the force fades. Allowed again.
            if self.id ~= 0
                haptic_mex('close', self.id);
                self.id = uint64(0);
            end
        end

        function state = wait(self, seconds)
        %WAIT  Waits for a device state that is newer than the last one. An error after that many seconds (10).
            if nargin < 2
                seconds = 10;
            end
            if ~(isnumeric(seconds) && isreal(seconds) && isscalar(seconds) && seconds >= 0)
                error('haptic:invalidArgument', 'Haptic.wait: a number of seconds that is not negative is needed');
            end
            deadline_ns = Haptic.now_ns() + int64(1e9 * double(seconds));
            state = read(self);
            while isempty(state)
                if Haptic.now_ns() > deadline_ns
                    error('haptic:timeout', ...
                          'Haptic.wait: no device state in session %s within %g s: start rt-core run --session %s', ...
                          self.name, seconds, self.name);
                end
                pause(0.002);
                state = read(self);
            end
        end

        function state = read(self)
        %READ  The newest device state, or [] if there is none newer than the last one. Never waits.
            state = haptic_mex('read', self.id);
        end

        function sequence = publish(self, frame)
        %PUBLISH  Publishes a contact frame, and returns its sequence, uint64. Never waits.
        %
        %   An invalid frame is an error that names its defect, and is not published.
            try
                sequence = haptic_mex('publish', self.id, frame);
            catch problem
                if ~strcmp(problem.identifier, 'haptic:invalidFrame')
                    rethrow(problem);
                end
                % Without the functions that have found it.
                message = regexprep(problem.message, '^(haptic_\w+: )*', '');
                error('haptic:invalidFrame', 'Haptic.publish: %s%s', message, Haptic.place(message, frame));
            end
        end

        function beat(self)
        %BEAT  Signals that the simulation is alive without a new frame.
            haptic_mex('beat', self.id);
        end

        function peer = peer(self)
        %PEER  rt-core as the session sees it, a structure of
        %
        %   session       uint64   of the latest process of the device; 0 before the first
        %   heartbeat_ns  int64    last publication; 0 before the first
        %   pid           uint32   0: none is attached
        %   closed        uint32   1: it detached in an orderly way
            peer = haptic_mex('peer', self.id);
        end

        function states = states(self)
        %STATES  Observed device states that were not returned before, 1 x K.
        %
        %   A ring keeps the last 8: a gap in sequence is what was overwritten before it was read.
            states = haptic_mex('states', self.id);
        end

        function frames = frames(self)
        %FRAMES  Observed contact frames that were not returned before, 1 x K; as states.
            frames = haptic_mex('frames', self.id);
        end
    end

    methods (Static)
        function ns = now_ns()
        %NOW_NS  CLOCK_MONOTONIC in nanoseconds, int64: the clock of every time in a frame.
            ns = Haptic.gateway('now_ns');
        end

        function frame = frame(proxies)
        %FRAME  A contact frame of so many proxies, without contact. Set step_ns, stiffness, and what is not 0.
            if nargin < 1
                proxies = 1;
            end
            if ~(isnumeric(proxies) && isscalar(proxies) && any(proxies == 0:64))
                error('haptic:invalidArgument', 'Haptic.frame: a frame has 0 to 64 proxies');
            end
            frame = struct('state_sequence', uint64(0), 'state_time_ns', int64(0), 'plane_time_ns', int64(0), ...
                           'step_ns', int64(0), 'stiffness', 0, 'torque_stiffness', 0, 'static_friction', 0, ...
                           'dynamic_friction', 0, 'body_work', 0, 'flags', 0, 'rest_offset', zeros(3, proxies), ...
                           'rest_velocity', zeros(3, proxies), 'radius', zeros(1, proxies), ...
                           'position', zeros(3, proxies), 'surface_velocity', zeros(3, proxies), ...
                           'in_contact', zeros(1, proxies), 'plane_count', zeros(1, proxies), ...
                           'plane_normal', zeros(3, 3, proxies), ...
                           'plane_offset', zeros(3, proxies), 'plane_velocity', zeros(3, proxies), 'compliance', []);
        end

        function names = describe(state)
        %DESCRIBE  Names of a device state's bits, a structure of
        %
        %   safety_state  text
        %   faults        1 x K cell array of text, latched until the device is armed again
        %   tick_flags    1 x K cell array of text, what this tick dropped or limited
            safety_states = {'disarmed', 'tensioning', 'calibrating', 'running', 'faulted', 'proving'};
            faults = {'exchange', 'encoder_jump', 'slack', 'residual', 'overrun', 'nonfinite', 'stop', 'thermal', ...
                      'watchdog', 'wiring', 'pose', 'budget', 'guard'};
            tick_flags = {'overrun', 'frame_stale', 'frame_rejected', 'force_limited', 'slew_limited', ...
                          'wrench_unreachable', 'exchange_failed', 'derated', 'stiffness_limited', ...
                          'passivity_limited', 'probe_off', 'unproven', 'commissioning', 'workspace_edge', ...
                          'arm_awaited', 'budget_low', 'overlay'};
            names = struct();
            names.safety_state = safety_states{double(state.safety_state) + 1};
            names.faults = faults(bitget(state.faults, 1:numel(faults)) == 1);
            names.tick_flags = tick_flags(bitget(state.tick_flags, 1:numel(tick_flags)) == 1);
        end
    end

    methods (Static, Access = private)
        function varargout = gateway(varargin)
        %GATEWAY  Calls haptic_mex, and says what to do if it cannot be loaded.
            try
                [varargout{1:nargout}] = haptic_mex(varargin{:});
            catch problem
                if strncmp(problem.identifier, 'haptic:', 7)
                    rethrow(problem);
                end
                error('haptic:notLoaded', ...
                      ['Haptic: haptic_mex could not be loaded: %s\n' ...
                       'Compile haptic_mex.c, as its first lines say, into a folder of the path (addpath). It needs ' ...
                       'libhaptic.so.0: install libhaptic0, or name its folder in LD_LIBRARY_PATH before the start.'], ...
                      problem.message);
            end
        end

        function place = place(message, frame)
        %PLACE  Where the number or normal is that libhaptic refused; '' if the message is about something else.
            place = '';
            not_finite = ~isempty(strfind(message, 'not finite'));
            if ~not_finite && isempty(strfind(message, 'unit length'))
                return
            end
            % Planes beyond a proxy's plane_count may have any values.
            counted = bsxfun(@le, (1:3)', double(frame.plane_count));
            frame.plane_offset(~counted) = 0;
            frame.plane_velocity(~counted) = 0;
            frame.plane_normal(repmat(reshape(~counted, 1, 3, []), [3, 1, 1])) = 0;
            if not_finite
                names = fieldnames(frame);
                for k = 1:numel(names)
                    value = frame.(names{k});
                    first = find(~isfinite(value), 1);
                    if ~isempty(first)
                        [row, column, page] = ind2sub([size(value), 1], first);
                        pages = {sprintf(', %d', page), ''};
                        place = sprintf(': frame.%s(%d, %d%s) is %g', names{k}, row, column, ...
                                        pages{1 + (ndims(value) < 3)}, value(first));
                        return
                    end
                end
            else
                lengths = reshape(sqrt(sum(frame.plane_normal .^ 2, 1)), 3, []);
                [plane, proxy] = find(counted & abs(lengths - 1) > 1e-6, 1);
                place = sprintf(': frame.plane_normal(:, %d, %d) has length %g', plane, proxy, lengths(plane, proxy));
            end
        end
    end
end
