# Style of all plots of this project, for gnuplot: those of the pages of measurements, of the thesis' figures and of the
# demo. The file is embedded in the programs and stands before the commands of each plot.
set terminal svg size 720,320 dynamic noenhanced font 'sans-serif,13'
# eval half_width: for plots side by side, with letters as large.
half_width = "set terminal svg size 480,320 dynamic noenhanced font 'sans-serif,13'"
set encoding utf8
set datafile separator comma
set border 3 linecolor '#666666'
set grid linetype 1 linewidth 1 linecolor '#dddddd'
set tics nomirror
set style fill solid 1 noborder
set key outside top center horizontal
# Room for half of a long label at the right end of the x axis, such as "99.9999 %".
set rmargin 6

# Eight colours that people with any colour vision tell apart and that stand out from light paper; the first four are those
# of style.css. In dark mode style.css inverts the picture.
set linetype 1 linewidth 1.5 linecolor '#2a6f97'
set linetype 2 linewidth 1.5 linecolor '#c8553d'
set linetype 3 linewidth 1.5 linecolor '#5f8744'
set linetype 4 linewidth 1.5 linecolor '#b3710f'
set linetype 5 linewidth 1.5 linecolor '#8b8f92'
set linetype 6 linewidth 1.5 linecolor '#7a1f8f'
set linetype 7 linewidth 1.5 linecolor '#2b95d6'
set linetype 8 linewidth 1.5 linecolor '#2a2f32'

# The same quantity has the same colour in every plot: "linecolor proxy".
ours = 1; thesis = 2
along_x = 2; along_y = 3; along_z = 1
proxy = 1; hand = 8
p50 = 1; p99 = 4; p999 = 6; maximum = 2
wakeup = 1; exchange = 2; compute = 3; motion_to_force = 4; cyclictest = 2; timerlat = 6

# A number as label of an axis: "0.5", "20", "1,500", "2 million".
number_text(v) = v >= 1e6 ? sprintf('%g million', v / 1e6) : \
    v >= 1e3 ? sprintf('%d,%03d', int(v) / 1000, int(v) % 1000) : sprintf('%g', v)

# eval log_axis('x', FROM, TO): a logarithmic axis with labels at 1, 2 and 5 times powers of ten, over many decades at the
# powers alone. A range of less than a decade, which would have hardly a label, becomes a linear axis.
log_axis(axis, from, to) = to < 8 * from ? \
    sprintf('unset logscale %s; set %srange [%g:%g]', axis, axis, from, to) : \
    sprintf('set logscale %s; set %srange [%g:%g]; set %stics ("" %g); ', axis, axis, from, to, axis, from) . \
    sprintf('set for [e=%d:%d] for [m in "%s"] %stics add (number_text(m * 10**e) m * 10**e)', \
            floor(log10(from)), ceil(log10(to)), to >= 2000 * from ? '1' : '1 2 5', axis)
