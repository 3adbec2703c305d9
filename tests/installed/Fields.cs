// Every field of Haptic.cs with a value of its own, for check_csharp.py: Fields.exe SESSION. Prints the layout of
// DeviceState and what is refused; publishes one frame and waits for the end of its input.

using System;
using System.Reflection;
using System.Runtime.InteropServices;

static class Fields
{
    static void Refused(Action action)
    {
        try { action(); Console.WriteLine("accepted"); }
        catch (Exception error) { Console.WriteLine("refused " + error.Message.Replace('\n', ' ')); }
    }

    static Haptic.Vector Numbers(double first) { return new Haptic.Vector(first, first + 1, first + 2); }

    static void Main(string[] arguments)
    {
        foreach (FieldInfo field in typeof(Haptic.DeviceState).GetFields())
            Console.WriteLine("field {0} {1}", field.Name, Marshal.OffsetOf(typeof(Haptic.DeviceState), field.Name));
        Console.WriteLine("size {0}", Marshal.SizeOf(typeof(Haptic.DeviceState)));
        Refused(() => new Haptic.Session("../x"));
        using (var session = new Haptic.Session(arguments[0]))
        using (var frame = new Haptic.ContactFrame())
        {
            Refused(() => session.Publish(frame)); // its step is 0
            Refused(() => frame.SetPlane(64, 0, Numbers(0), 0));
            Refused(() => frame.SetPlaneCount(0, 4));
            frame.StateSequence = 11;
            frame.StateTimeNs = 12;
            frame.PlaneTimeNs = 13;
            frame.StepNs = 14;
            frame.Stiffness = 15;
            frame.TorqueStiffness = 16;
            frame.StaticFriction = 18;
            frame.DynamicFriction = 17;
            frame.BodyWork = 19;
            frame.Flags = Haptic.ContactFrame.Overconstrained;
            frame.ProxyCount = 64;
            for (int i = 0; i < 64; ++i)
            {
                frame.SetProxy(i, Numbers(100 * i), Numbers(100 * i + 3), Haptic.ContactFrame.Sticks);
                frame.SetVelocities(i, Numbers(100 * i + 6), Numbers(100 * i + 9));
                frame.SetRadius(i, 0.125 * i + 0.0625);
                frame.SetPlaneCount(i, 3);
                frame.SetPlane(i, 0, new Haptic.Vector(1, 0, 0), 100 * i + 12, 100 * i + 13);
                frame.SetPlane(i, 1, new Haptic.Vector(0, 1, 0), 100 * i + 14, 100 * i + 15);
                frame.SetPlane(i, 2, new Haptic.Vector(0, 0, 1), 100 * i + 16, 100 * i + 17);
            }
            Console.WriteLine("published {0}", session.Publish(frame));
            Console.In.ReadToEnd();
        }
        Refused(() => new Haptic.ContactFrame().SetProxy(-1, Numbers(0), Numbers(0)));
    }
}
