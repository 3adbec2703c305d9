// libhaptic.so from C#: Mono, .NET and Unity. One file, without unsafe code: copy it to your project. Its classes are the
// functions and structures of haptic.h and frames.h, which say more about each.
//
// SI units; the device frame is right-handed, x to the right, y up, z to the person; quaternions are (w, x, y, z). Unity's
// frames are left-handed: Vector.Mirrored and Quaternion.Mirrored convert, in both directions.

using System;
using System.Runtime.InteropServices;

namespace Haptic
{
    [StructLayout(LayoutKind.Sequential)]
    public struct Vector
    {
        public double X, Y, Z;
        public Vector(double x, double y, double z) { X = x; Y = y; Z = z; }
        /// <summary>The same vector in Unity's frame, or back.</summary>
        public Vector Mirrored { get { return new Vector(X, Y, -Z); } }
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Quaternion
    {
        public double W, X, Y, Z;
        /// <summary>The same rotation in Unity's frame, or back.</summary>
        public Quaternion Mirrored { get { return new Quaternion { W = W, X = -X, Y = -Y, Z = Z }; } }
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Tensions
    {
        public double String0, String1, String2, String3, String4, String5, String6, String7;
    }

    /// <summary>haptic_device_state.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct DeviceState
    {
        public ulong Sequence, Session;
        public long LatchTimeNs;
        public ulong FrameSequence;
        public Vector Position;                        // m, of the grip
        public Quaternion Orientation;                 // device_from_grip
        public Vector LinearVelocity, AngularVelocity; // m/s, rad/s
        public Vector Force, Torque;                   // N, N m, exerted by the strings
        public Vector ProxyPosition;                   // m
        public Tensions Tension;                       // N
        public double Stiffness, Scale;                // N/m, 0..1: of what is rendered
        public Vector Impulse, AngularImpulse;         // N s, N m s
        public uint SafetyState, Faults, TickFlags, Buttons;
    }

    public class HapticException : Exception
    {
        public HapticException(string message) : base(message) { }
    }

    /// <summary>haptic_contact_frame: the contact planes of each sphere of a tool. Begins with no sphere.</summary>
    public sealed class ContactFrame : IDisposable
    {
        public const int MaxProxies = 64, MaxPlanes = 3;
        public const uint Touches = 1, Sticks = 2;             // bits of a proxy's contact
        public const uint Overconstrained = 1, Clutched = 2;   // bits of Flags

        const int Header = 112, ProxyBytes = 232, Planes = 112, PlaneBytes = 40, Bytes = Header + MaxProxies * ProxyBytes + 18528 * 4;
        IntPtr memory = Marshal.AllocHGlobal(Bytes);

        public ContactFrame()
        {
            for (int k = 0; k < Bytes; k += 8) Marshal.WriteInt64(memory, k, 0);
        }

        internal IntPtr Memory
        {
            get
            {
                if (memory == IntPtr.Zero) throw new ObjectDisposedException("Haptic.ContactFrame");
                return memory;
            }
        }

        public ulong StateSequence { set { Marshal.WriteInt64(Memory, 16, (long)value); } }
        public long StateTimeNs { set { Marshal.WriteInt64(Memory, 24, value); } }
        /// <summary>When the offsets of the planes hold.</summary>
        public long PlaneTimeNs { set { Marshal.WriteInt64(Memory, 32, value); } }
        /// <summary>Until the next frame.</summary>
        public long StepNs { set { Marshal.WriteInt64(Memory, 48, value); } }
        /// <summary>N/m, of the coupling as felt at the hand.</summary>
        public double Stiffness { set { Put(56, value); } }
        public double TorqueStiffness { set { Put(64, value); } }
        public double StaticFriction { set { Put(72, value); } }
        public double DynamicFriction { set { Put(80, value); } }
        /// <summary>J at the hand, over the session.</summary>
        public double BodyWork { set { Put(88, value); } }
        public uint Flags { set { Marshal.WriteInt32(Memory, 100, (int)value); } }

        public int ProxyCount
        {
            get { return Marshal.ReadInt32(Memory, 96); }
            set
            {
                if (value < 0 || value > MaxProxies) throw new ArgumentOutOfRangeException("value", "a frame has 0 to 64 proxies");
                Marshal.WriteInt32(Memory, 96, value);
            }
        }

        /// <summary>A sphere: where it is without contact (m, grip frame), where it is (m, device frame), bits of its contact.</summary>
        public void SetProxy(int proxy, Vector restOffset, Vector position, uint contact = 0)
        {
            int at = ProxyAt(proxy);
            Put(at, restOffset);
            Put(at + 56, position);
            Marshal.WriteInt32(Memory, at + 104, (int)contact);
        }

        /// <summary>m/s: of the rest offset (grip frame), and of the touched surface.</summary>
        public void SetVelocities(int proxy, Vector rest, Vector surface)
        {
            Put(ProxyAt(proxy) + 24, rest);
            Put(ProxyAt(proxy) + 80, surface);
        }

        /// <summary>m, 0 to 10, of a sphere that turns with the grip: friction acts this much off its centre, where it touches
        /// its first plane. 0: at the centre.</summary>
        public void SetRadius(int proxy, double radius) { Put(ProxyAt(proxy) + 48, radius); }

        public void SetPlaneCount(int proxy, int planes)
        {
            if (planes < 0 || planes > MaxPlanes) throw new ArgumentOutOfRangeException("planes", "a proxy has 0 to 3 planes");
            Marshal.WriteInt32(Memory, ProxyAt(proxy) + 108, planes);
        }

        /// <summary>Allowed is dot(normal, centre) >= offset. The unit normal points out of the surface; m, m/s along it.</summary>
        public void SetPlane(int proxy, int plane, Vector normal, double offset, double velocity = 0.0)
        {
            if (plane < 0 || plane >= MaxPlanes) throw new ArgumentOutOfRangeException("plane", "a proxy has planes 0 to 2");
            int at = ProxyAt(proxy) + Planes + plane * PlaneBytes;
            Put(at, normal);
            Put(at + 24, offset);
            Put(at + 32, velocity);
        }

        public void Dispose()
        {
            Marshal.FreeHGlobal(memory);
            memory = IntPtr.Zero;
            GC.SuppressFinalize(this);
        }

        ~ContactFrame() { Marshal.FreeHGlobal(memory); }

        static int ProxyAt(int proxy)
        {
            if (proxy < 0 || proxy >= MaxProxies) throw new ArgumentOutOfRangeException("proxy", "a frame has proxies 0 to 63");
            return Header + proxy * ProxyBytes;
        }

        void Put(int at, double value) { Marshal.WriteInt64(Memory, at, BitConverter.DoubleToInt64Bits(value)); }

        void Put(int at, Vector value)
        {
            Put(at, value.X);
            Put(at + 8, value.Y);
            Put(at + 16, value.Z);
        }
    }

    /// <summary>The simulation's end of a session with rt-core. One thread at a time.</summary>
    public sealed class Session : IDisposable
    {
        const uint Abi = 6;
        IntPtr states, contacts;

        public Session(string name = "default")
        {
            uint found;
            try { found = Native.haptic_abi_version(); }
            catch (DllNotFoundException)
            {
                throw new HapticException("libhaptic.so.0 was not found: install libhaptic0, or name its folder in LD_LIBRARY_PATH");
            }
            if (found != Abi) throw new HapticException("libhaptic.so.0 has ABI " + found + ", and Haptic.cs was written for " + Abi);
            states = Native.haptic_state_reader_open(name);
            if (states == IntPtr.Zero) throw LastError();
            contacts = Native.haptic_contact_writer_open(name);
            if (contacts != IntPtr.Zero) return;
            HapticException error = LastError();
            Dispose();
            throw error;
        }

        /// <summary>CLOCK_MONOTONIC, the clock of every time in a frame.</summary>
        public static long NowNs { get { return Native.haptic_now_ns(); } }

        /// <summary>The newest state of the device; false if there is none newer than the last one. Never waits.</summary>
        public bool Read(ref DeviceState state)
        {
            int found = Native.haptic_state_reader_read(states, ref state);
            if (found < 0) throw LastError();
            return found == 1;
        }

        /// <summary>Publishes a frame and returns its sequence. Never waits. Throws for an invalid frame, with its defect.</summary>
        public ulong Publish(ContactFrame frame)
        {
            ulong sequence = Native.haptic_contact_writer_publish(contacts, frame.Memory, NowNs);
            if (sequence == 0) throw LastError();
            return sequence;
        }

        /// <summary>Signals that the simulation is alive without a new frame.</summary>
        public void Beat() { Native.haptic_contact_writer_beat(contacts, NowNs); }

        /// <summary>Detaches. rt-core knows at once, and the force fades.</summary>
        public void Dispose()
        {
            if (contacts != IntPtr.Zero) Native.haptic_contact_writer_close(contacts);
            if (states != IntPtr.Zero) Native.haptic_state_reader_close(states);
            states = contacts = IntPtr.Zero;
            GC.SuppressFinalize(this);
        }

        ~Session() { Dispose(); }

        static HapticException LastError()
        {
            return new HapticException(Marshal.PtrToStringAnsi(Native.haptic_last_error()));
        }
    }

    static class Native
    {
        const string Library = "libhaptic.so.0";
        [DllImport(Library)] internal static extern uint haptic_abi_version();
        [DllImport(Library)] internal static extern IntPtr haptic_last_error();
        [DllImport(Library)] internal static extern long haptic_now_ns();
        [DllImport(Library)] internal static extern IntPtr haptic_contact_writer_open([MarshalAs(UnmanagedType.LPStr)] string session);
        [DllImport(Library)] internal static extern void haptic_contact_writer_close(IntPtr writer);
        [DllImport(Library)] internal static extern ulong haptic_contact_writer_publish(IntPtr writer, IntPtr frame, long nowNs);
        [DllImport(Library)] internal static extern int haptic_contact_writer_beat(IntPtr writer, long nowNs);
        [DllImport(Library)] internal static extern IntPtr haptic_state_reader_open([MarshalAs(UnmanagedType.LPStr)] string session);
        [DllImport(Library)] internal static extern void haptic_state_reader_close(IntPtr reader);
        [DllImport(Library)] internal static extern int haptic_state_reader_read(IntPtr reader, ref DeviceState state);
    }
}
