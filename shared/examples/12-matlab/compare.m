function [time, felt, expected] = compare(file)
%COMPARE  The force of a recording beside that of the plate's differential equation: compare('build/rt-core.csv')
%
%   time      K x 1   s, of the ticks from the first contact to the end of the plate
%   felt      K x 1   N, upward, on the hand
%   expected  K x 1   N, by ode45, from nothing but the recorded height of the hand
    mass = 0.2;          % as in plate.m
    spring = 125;
    damper = 3;
    coupling = 500;

    % Columns have names in the first line; all else are numbers.
    id = fopen(file);
    if id < 0
        error('compare:file', 'compare: %s cannot be read: name a file that rt-core run --record has written', file);
    end
    names = strsplit(strtrim(fgetl(id)), ',');
    fclose(id);
    table = dlmread(file, ',', 1, 0);
    column = @(name) table(:, strcmp(names, name));
    time = column('time_s');
    hand = column('y_m');
    felt = column('fy_n');
    first = find(hand < 0, 1);
    last = find(column('scale') == 1, 1, 'last');
    if isempty(first) || isempty(last) || last <= first
        error('compare:contact', 'compare: in %s the hand has felt nothing: was the plate in the same session?', file);
    end

    % m y'' = -k y - d y' - F with F = c max(0, y - h), h the height of the hand.
    force = @(y, h) coupling * max(0, y - h);
    motion = @(t, x) [x(2); (-spring * x(1) - damper * x(2) - force(x(1), interp1(time, hand, t))) / mass];
    [~, x] = ode45(motion, time(first:last), [0; 0]);
    time = time(first:last);
    felt = felt(first:last);
    expected = force(x(:, 1), hand(first:last));
    fprintf('%.3f N between felt and expected, root mean square of %d ticks\n', ...
            sqrt(mean((felt - expected) .^ 2)), numel(time));
end
