// A round bowl of 20 mm, felt from inside as a spring: Bowl.exe [SESSION [SECONDS]]

using System;
using System.Threading;

static class Bowl
{
    const double Radius = 0.02;     // m
    const double Stiffness = 400.0; // N/m

    static int Main(string[] arguments)
    {
        string name = arguments.Length > 0 ? arguments[0] : "default";
        double seconds = arguments.Length > 1 ? double.Parse(arguments[1]) : 10.0;
        try
        {
            using (var session = new Haptic.Session(name))
            using (var frame = new Haptic.ContactFrame { StepNs = 1000000, Stiffness = Stiffness, ProxyCount = 1 })
                Console.WriteLine("{0:F2} N felt at most, {1} frames", Feel(session, frame, seconds, out int frames), frames);
            return 0;
        }
        catch (Haptic.HapticException error)
        {
            Console.Error.WriteLine("Bowl: " + error.Message);
            return 1;
        }
    }

    static double Feel(Haptic.Session session, Haptic.ContactFrame frame, double seconds, out int frames)
    {
        var state = new Haptic.DeviceState();
        double peak = 0.0;
        frames = 0;
        for (long end = Haptic.Session.NowNs + (long)(1e9 * seconds); Haptic.Session.NowNs < end; Thread.Sleep(1))
        {
            if (session.Read(ref state))
            {
                frame.StateSequence = state.Sequence;
                frame.StateTimeNs = state.LatchTimeNs;
            }
            // The plane that touches the bowl where the grip is nearest to it: its normal points to the centre.
            Haptic.Vector p = state.Position;
            double distance = Math.Sqrt(p.X * p.X + p.Y * p.Y + p.Z * p.Z);
            var normal = distance > 1e-6 ? new Haptic.Vector(-p.X / distance, -p.Y / distance, -p.Z / distance)
                                         : new Haptic.Vector(0.0, 1.0, 0.0);
            double part = distance > Radius ? Radius / distance : 1.0;
            frame.SetProxy(0, new Haptic.Vector(), new Haptic.Vector(part * p.X, part * p.Y, part * p.Z),
                           distance > Radius ? Haptic.ContactFrame.Touches : 0);
            frame.SetPlane(0, 0, normal, -Radius);
            frame.SetPlaneCount(0, 1);
            frame.PlaneTimeNs = Haptic.Session.NowNs;
            session.Publish(frame);
            ++frames;
            Haptic.Vector f = state.Force;
            peak = Math.Max(peak, Math.Sqrt(f.X * f.X + f.Y * f.Y + f.Z * f.Z));
        }
        return peak;
    }
}
